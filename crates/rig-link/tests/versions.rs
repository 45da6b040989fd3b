//! The greeting between builds of different versions. These bytes must never change.

use rig_link::{Decoder, MAX_FRAME, Message, PROTOCOL_HASH, Request, Versions, encode};
use serde::de::DeserializeOwned;

/// Frame 7 of a build of version 9.8.7, git 0123abcd-dirty, protocol 0x12345678, made by hand: COBS of sequence number,
/// 0, hash, both texts and CRC-32.
const GREETING: [u8; 62] = [
    0x00, 0x02, 0x07, 0x01, 0x0a, 0x78, 0x56, 0x34, 0x12, 0x39, 0x2e, 0x38, 0x2e, 0x37, 0x01, 0x01, 0x01, 0x01, 0x01,
    0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x0f, 0x30, 0x31, 0x32, 0x33, 0x61,
    0x62, 0x63, 0x64, 0x2d, 0x64, 0x69, 0x72, 0x74, 0x79, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x05,
    0x04, 0x23, 0x26, 0xb6, 0x00,
];

fn decoded<T: DeserializeOwned>(bytes: &[u8]) -> Option<(u16, T)> {
    let mut decoder = Decoder::new();
    bytes.iter().find_map(|&byte| decoder.push(byte)?.ok()).map(|frame| (frame.sequence, frame.body))
}

fn another() -> Versions {
    Versions::new(0x1234_5678, "9.8.7", "0123abcd-dirty")
}

#[test]
fn a_tool_understands_a_board_of_another_version_and_names_both() {
    let Some((7, Message::Hello(board))) = decoded(&GREETING) else { panic!("not understood") };
    assert_eq!((board.protocol_hash(), board.version(), board.git()), (0x1234_5678, "9.8.7", "0123abcd-dirty"));
    let tool = Versions::own("0.1.0", "");
    assert_eq!(tool.check_board(&Versions::own("0.2.0", "feed")), Ok(()), "the protocol counts, not the version");
    let message = tool.check_board(&board).expect_err("another protocol").to_string();
    let own = format!("{PROTOCOL_HASH:#010x}");
    for named in ["0.1.0", "unknown", own.as_str(), "9.8.7", "0123abcd-dirty", "0x12345678", "cargo xtask flash"] {
        assert!(message.contains(named), "{named}: {message}");
    }
}

#[test]
fn a_board_understands_a_tool_of_another_version() {
    assert_eq!(decoded(&GREETING), Some((7, Request::Hello(another()))));
}

#[test]
fn greetings_of_both_sides_are_written_in_these_bytes() {
    let mut buffer = [0; MAX_FRAME];
    assert_eq!(encode(7, &Request::Hello(another()), &mut buffer), Ok(&GREETING[..]));
    assert_eq!(encode(7, &Message::Hello(another()), &mut buffer), Ok(&GREETING[..]));
}

#[test]
fn texts_are_cut_and_faulty_ones_do_no_harm() {
    let long = Versions::own("1.2.3-with-a-very-long-name-behind", "é");
    assert_eq!((long.version(), long.git()), ("1.2.3-with-a-very-long-n", "é"));
    assert_eq!(Versions::own("twenty-three-charactersé", "").version(), "twenty-three-characters");
}
