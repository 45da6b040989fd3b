//! Which of the host's requests are new. A serial line with a buffer on its way (a hub, a bridge, a radio) may deliver old
//! bytes again; a `move` of a minute ago must not be carried out a second time.

/// How far behind the newest number (in messages) a frame counts as an old one. Numbers wrap after 65 536.
const BEHIND: u16 = 1 << 15;

/// The newest number of a host.
#[derive(Clone, Copy, Debug, Default)]
pub struct Newest(Option<u16>);

impl Newest {
    /// No number yet.
    pub const fn new() -> Self {
        Self(None)
    }

    /// A host begins with this number, whatever came before.
    pub fn begin(&mut self, sequence: u16) {
        self.0 = Some(sequence);
    }

    /// Whether a message with this number is newer than all before it. If so, it becomes the newest.
    pub fn is_new(&mut self, sequence: u16) -> bool {
        let new = self.0.is_none_or(|newest| (1..BEHIND).contains(&sequence.wrapping_sub(newest)));
        if new {
            self.0 = Some(sequence);
        }
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_counts_once_and_they_come_round() {
        let mut newest = Newest::new();
        assert!(newest.is_new(7) && !newest.is_new(7) && !newest.is_new(6));
        assert!(newest.is_new(20), "some were lost on the way");
        assert!(!newest.is_new(8));
        newest.begin(65_535);
        assert!(!newest.is_new(65_535) && newest.is_new(0) && !newest.is_new(65_535) && newest.is_new(1));
        newest.begin(3);
        assert!(newest.is_new(4), "another host, or the same started anew");
    }
}
