//! Standard input, read ahead: a machine that a debugger holds must see that nobody runs it any more.

use std::io::{ErrorKind, Read, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};

/// What has been read of an input.
pub struct Host {
    pieces: Receiver<Vec<u8>>,
    piece: std::io::Cursor<Vec<u8>>,
}

impl Host {
    /// Reads `input` on a thread of its own. The flag is set when it has ended.
    pub fn new(mut input: impl Read + Send + 'static) -> (Self, Arc<AtomicBool>) {
        let (send, pieces) = channel();
        let gone = Arc::new(AtomicBool::new(false));
        let flag = gone.clone();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            loop {
                match input.read(&mut bytes) {
                    Ok(count @ 1..) if send.send(bytes[..count].to_vec()).is_ok() => {}
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    _ => break,
                }
            }
            flag.store(true, Ordering::Relaxed);
        });
        (Self { pieces, piece: std::io::Cursor::default() }, gone)
    }
}

impl Read for Host {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        loop {
            match self.piece.read(into)? {
                0 if !into.is_empty() => match self.pieces.recv() {
                    Ok(piece) => self.piece = std::io::Cursor::new(piece),
                    // The thread has ended with the input.
                    Err(_) => return Ok(0),
                },
                count => return Ok(count),
            }
        }
    }
}
