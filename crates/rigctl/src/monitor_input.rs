//! What the operator types, from the bytes of the terminal to keys.
//!
//! The whole of what has come is looked at, however long it is: crossterm reads 1024 bytes at a time and does not look
//! for more until the next key. A space or Ctrl-C is found in all of it, also in pasted text, and nothing else of it then counts.
//! Other pasted text is ignored. A terminal that marks it does so between `ESC [ 200 ~` and `ESC [ 201 ~`.

use ratatui::crossterm::event::KeyCode;

const PASTE: &[u8] = b"\x1b[200~";
const PASTED: &[u8] = b"\x1b[201~";
/// Longest sequence of one key that is waited for (bytes).
const LONGEST: usize = 16;

/// What has come since the last look.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Typed {
    /// Ctrl-C.
    Leave,
    /// The space bar.
    Stop,
    /// Keys in order, and whether there was pasted text among them, which is dropped.
    Keys(Vec<KeyCode>, bool),
}

/// Takes bytes apart.
#[derive(Debug, Default)]
pub struct Input {
    /// The beginning of a sequence whose end has not come.
    rest: Vec<u8>,
    pasting: bool,
}

impl Input {
    /// What these bytes mean, which are all that has come since the last call.
    pub fn take(&mut self, bytes: &[u8]) -> Typed {
        let urgent = if bytes.contains(&3) { Some(Typed::Leave) } else { bytes.contains(&b' ').then_some(Typed::Stop) };
        // An escape that nothing follows is the key itself.
        let complete = bytes.is_empty();
        self.rest.extend_from_slice(bytes);
        let all = std::mem::take(&mut self.rest);
        let (mut rest, mut keys, mut pasted) = (all.as_slice(), Vec::new(), false);
        while let Some((first, others)) = rest.split_first() {
            if self.pasting {
                pasted = true;
                if rest.starts_with(PASTED) {
                    (self.pasting, rest) = (false, &rest[PASTED.len()..]);
                } else if PASTED.starts_with(rest) && !complete {
                    break;
                } else {
                    rest = others;
                }
            } else if rest.starts_with(PASTE) {
                (self.pasting, rest) = (true, &rest[PASTE.len()..]);
            } else if *first == 0x1b {
                match sequence(rest) {
                    Some((key, length)) => {
                        keys.extend(key);
                        rest = &rest[length..];
                    }
                    None if !complete && rest.len() < LONGEST => break,
                    None => {
                        keys.push(KeyCode::Esc);
                        rest = others;
                    }
                }
            } else {
                keys.extend(key(*first));
                rest = others;
            }
        }
        self.rest = rest.to_vec();
        urgent.unwrap_or(Typed::Keys(keys, pasted))
    }
}

/// A key's sequence and its length; none if it is not complete, or no sequence.
fn sequence(bytes: &[u8]) -> Option<(Option<KeyCode>, usize)> {
    if !matches!(bytes.get(1), Some(b'[' | b'O')) {
        return None;
    }
    let end = 2 + bytes.get(2..)?.iter().position(|byte| (0x40..=0x7e).contains(byte))?;
    let key = match bytes[end] {
        b'A' => Some(KeyCode::Up),
        b'B' => Some(KeyCode::Down),
        b'C' => Some(KeyCode::Right),
        b'D' => Some(KeyCode::Left),
        _ => None,
    };
    Some((key.filter(|_| end == 2), end + 1))
}

fn key(byte: u8) -> Option<KeyCode> {
    match byte {
        b'\r' | b'\n' => Some(KeyCode::Enter),
        8 | 0x7f => Some(KeyCode::Backspace),
        b'!'..=b'~' => Some(KeyCode::Char(char::from(byte))),
        _ => None,
    }
}

#[cfg(unix)]
pub use unix::Terminal;

#[cfg(unix)]
mod unix {
    use super::{Input, Typed};
    use std::io::{self, Read};
    use std::sync::mpsc::{self, Receiver};

    /// Standard input, read by a thread of its own until the process ends.
    pub struct Terminal {
        input: Input,
        pieces: Receiver<Vec<u8>>,
    }

    impl Terminal {
        /// Begins to read.
        pub fn start() -> Self {
            let (read, pieces) = mpsc::channel();
            std::thread::spawn(move || {
                let mut buffer = [0; 4096];
                while let Ok(count @ 1..) = io::stdin().read(&mut buffer) {
                    if read.send(buffer[..count].to_vec()).is_err() {
                        return;
                    }
                }
            });
            Self { input: Input::default(), pieces }
        }

        /// What has come since the last call.
        ///
        /// # Errors
        /// Never, on this system.
        pub fn typed(&mut self) -> io::Result<Typed> {
            Ok(self.input.take(&self.pieces.try_iter().flatten().collect::<Vec<u8>>()))
        }
    }
}

#[cfg(not(unix))]
pub use events::Terminal;

#[cfg(not(unix))]
mod events {
    use super::Typed;
    use ratatui::crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers, poll, read};
    use std::io;
    use std::time::Duration;

    /// The events of a console.
    pub struct Terminal;

    impl Terminal {
        /// Begins to read.
        pub fn start() -> Self {
            Self
        }

        /// What has come since the last call.
        ///
        /// # Errors
        /// If the console fails.
        pub fn typed(&mut self) -> io::Result<Typed> {
            let (mut keys, mut pasted, mut leave) = (Vec::new(), false, false);
            while poll(Duration::ZERO)? {
                match read()? {
                    Event::Key(key) if key.kind == KeyEventKind::Press => {
                        leave |= key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                        keys.push(key.code);
                    }
                    Event::Paste(_) => pasted = true,
                    _ => {}
                }
            }
            Ok(match () {
                () if leave => Typed::Leave,
                () if keys.contains(&KeyCode::Char(' ')) => Typed::Stop,
                () => Typed::Keys(keys, pasted),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use KeyCode::{Backspace, Char, Down, Enter, Esc, Left, Right, Up};

    fn keys(keys: &[KeyCode]) -> Typed {
        Typed::Keys(keys.to_vec(), false)
    }

    #[test]
    fn keys_are_read_also_in_pieces() {
        let mut input = Input::default();
        assert_eq!(
            input.take(b"hm-8.5\r\x7f"),
            keys(&[Char('h'), Char('m'), Char('-'), Char('8'), Char('.'), Char('5'), Enter, Backspace])
        );
        assert_eq!(input.take(b"\x1b[A\x1b[B\x1bOC\x1b[D\x1b[1;5A\x1b[3~q"), keys(&[Up, Down, Right, Left, Char('q')]));
        assert_eq!(input.take(b"\x1b"), keys(&[]));
        assert_eq!(input.take(b"[A"), keys(&[Up]));
        assert_eq!((input.take(b"\x1b"), input.take(b"")), (keys(&[]), keys(&[Esc])));
        assert_eq!(input.take("h\u{e4}h".as_bytes()), keys(&[Char('h'), Char('h')]));
    }

    #[test]
    fn a_stop_is_found_however_much_comes_before_it() {
        let mut input = Input::default();
        let many = [b"\x1b[C".repeat(5000), b" ".to_vec(), b"hy".repeat(1000)].concat();
        assert_eq!(input.take(&many), Typed::Stop);
        assert_eq!(input.take(&[many.as_slice(), b"\x03"].concat()), Typed::Leave);
        assert_eq!(input.take(b"h"), keys(&[Char('h')]), "what came with it is gone");
    }

    #[test]
    fn pasted_text_is_no_keys_but_its_spaces_stop() {
        let mut input = Input::default();
        assert_eq!(input.take(b"h\x1b[200~yes\rhy\x1b[201~m"), Typed::Keys(vec![Char('h'), Char('m')], true));
        // In pieces, which are cut anywhere.
        for piece in ["\x1b[20", "0~hy", "\x1b", "[201", "~"] {
            assert!(matches!(input.take(piece.as_bytes()), Typed::Keys(keys, _) if keys.is_empty()), "{piece:?}");
        }
        assert_eq!(input.take(b"\x1b[200~home it, yes\x1b[201~h"), Typed::Stop);
        // A terminal that never ends its paste does not lock out the stop.
        assert!(matches!(input.take(b"\x1b[200~hy"), Typed::Keys(keys, true) if keys.is_empty()));
        assert_eq!(input.take(b" "), Typed::Stop);
        assert_eq!(input.take(b"\x03"), Typed::Leave);
    }
}
