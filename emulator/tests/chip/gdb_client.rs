//! A debugger's side of GDB's remote protocol.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// A connection.
pub struct Gdb(TcpStream);

/// So long an answer may take on a busy machine; only a test that fails waits for it.
const PATIENCE: Duration = Duration::from_secs(120);

impl Gdb {
    pub fn connect(address: &str) -> Self {
        let stream = TcpStream::connect(address).expect("somebody listens");
        stream.set_nodelay(true).expect("a socket");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        Self(stream)
    }

    pub fn send(&mut self, packet: &str) {
        let sum = packet.bytes().fold(0u8, u8::wrapping_add);
        self.0.write_all(format!("${packet}#{sum:02x}").as_bytes()).expect("sent");
    }

    /// Ctrl-C.
    pub fn interrupt(&mut self) {
        self.0.write_all(&[3]).expect("sent");
    }

    fn byte(&mut self) -> u8 {
        let mut byte = [0];
        self.0.read_exact(&mut byte).expect("an answer");
        byte[0]
    }

    /// Waits for the other side to close the connection.
    #[allow(dead_code, reason = "not every test waits for it")]
    pub fn has_ended(&mut self) -> bool {
        match self.0.read_to_end(&mut Vec::new()) {
            Ok(_) => true,
            Err(e) => e.kind() == ErrorKind::ConnectionReset,
        }
    }

    /// The next packet, run-length encoding undone.
    pub fn answer(&mut self) -> String {
        while self.byte() != b'$' {}
        let mut text = String::new();
        loop {
            match self.byte() {
                b'#' => break,
                b'*' => {
                    let last = text.chars().next_back().expect("a character to repeat");
                    let more = self.byte() - 29;
                    text.extend(std::iter::repeat_n(last, more.into()));
                }
                byte => text.push(byte.into()),
            }
        }
        let _sum = (self.byte(), self.byte());
        self.0.write_all(b"+").expect("sent");
        text
    }

    pub fn ask(&mut self, packet: &str) -> String {
        self.send(packet);
        self.answer()
    }

    /// Words of memory.
    #[allow(dead_code, reason = "not every test reads memory")]
    pub fn memory(&mut self, address: u32, words: usize) -> Vec<u32> {
        let text = self.ask(&format!("m{address:x},{:x}", 4 * words));
        words_of(&text)
    }

    /// r0 to r15 and xPSR.
    pub fn registers(&mut self) -> Vec<u32> {
        words_of(&self.ask("g"))[..17].to_vec()
    }

    pub fn pc(&mut self) -> u32 {
        self.registers()[15]
    }
}

fn words_of(hex: &str) -> Vec<u32> {
    let bytes: Vec<u8> =
        (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).expect("hexadecimal")).collect();
    bytes.as_chunks().0.iter().copied().map(u32::from_le_bytes).collect()
}
