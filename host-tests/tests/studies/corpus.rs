//! Everything that fuzzing ever found worth keeping (`fuzz/corpus.tar`, a folder for each door), and as many changed copies as
//! fit a bounded run.

#[path = "../../../fuzz/doors/mod.rs"]
mod doors;

use doors::DOORS;
use host_tests::root;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::collections::BTreeMap;
use std::io::Read;

/// The archive's files of each door, in its order.
fn corpus() -> BTreeMap<String, Vec<Vec<u8>>> {
    let path = root().join("fuzz/corpus.tar");
    let file = std::fs::File::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut files = BTreeMap::<String, Vec<Vec<u8>>>::new();
    for entry in tar::Archive::new(file).entries().unwrap() {
        let mut entry = entry.unwrap();
        let door = entry.path().unwrap().parent().unwrap().display().to_string();
        let mut data = Vec::new();
        entry.read_to_end(&mut data).unwrap();
        files.entry(door).or_default().push(data);
    }
    files
}

#[test]
fn no_door_breaks_on_what_fuzzing_kept() {
    let mut corpora = corpus();
    for (name, door, copies) in DOORS {
        let corpus = corpora.remove(*name).unwrap_or_else(|| panic!("no corpus for {name}"));
        corpus.iter().for_each(|data| door(data));
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(20);
        for _ in 0..*copies {
            let mut data = corpus.choose(&mut random).unwrap().clone();
            for _ in 0..random.random_range(1..6) {
                change(&mut data, &corpus, &mut random);
            }
            door(&data);
        }
        println!("{name}: {} files and {copies} changed copies", corpus.len());
    }
    assert!(!cfg!(unix) || corpora.is_empty(), "no door for {:?}", corpora.keys());
}

/// One change of the kind that parsers stumble over.
fn change(data: &mut Vec<u8>, corpus: &[Vec<u8>], random: &mut rand_pcg::Pcg64Mcg) {
    let at = random.random_range(0..=data.len());
    match random.random_range(0..6) {
        0 => data.truncate(at),
        1 => data.insert(at, random.random()),
        2 if at < data.len() => data[at] ^= 1 << random.random_range(0..8),
        3 if at < data.len() => data[at] = *[0, 0x7F, 0x80, 0xFF, b'-', b'e', b'\n'].choose(random).unwrap(),
        4 => {
            let tail = data.split_off(at);
            let other = corpus.choose(random).unwrap();
            data.extend_from_slice(&other[random.random_range(0..=other.len())..]);
            data.extend(tail);
            data.truncate(4096);
        }
        _ if at < data.len() => {
            data.remove(at);
        }
        _ => {}
    }
}
