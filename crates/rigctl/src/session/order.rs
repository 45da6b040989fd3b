//! The board's frames in order. The line may deliver an old frame twice, and the board numbers its frames again when it
//! restarts. In both cases number and time go back, but only after a restart do later frames continue from there.

use rig_link::{Frame, Message};

/// Maximum frames that are held back until it is clear whether they are old: those before a board's second telemetry.
const MAX_HELD: usize = 64;

/// The frames that were received so far.
#[derive(Default)]
pub struct Order {
    /// Number of the newest frame.
    heard: Option<u16>,
    /// Time of the newest telemetry on the board's clock (µs).
    t_us: Option<u64>,
    /// Frames that may be old, or the first of a board that has restarted.
    held: Vec<Frame<Message>>,
    /// Frames that never came.
    lost: u32,
}

impl Order {
    /// Frames of the board that never came, by the gaps in their numbers.
    pub fn lost(&self) -> u32 {
        self.lost
    }

    /// Takes a frame and returns the messages that are known to be new, in order.
    pub fn take(&mut self, frame: Frame<Message>) -> Vec<Message> {
        let Some(heard) = self.heard else { return vec![self.accept(frame, false)] };
        // Half of the numbers lie before any other.
        let steps = frame.sequence.wrapping_sub(heard);
        let ahead = (1..u16::MAX / 2).contains(&steps);
        let t_us = match &frame.body {
            Message::Telemetry(telemetry) => Some(telemetry.t_us),
            _ => None,
        };
        match (t_us, self.t_us) {
            // Ahead in time: after a long silence the number may be any.
            (Some(t_us), Some(last)) if t_us > last => {
                self.held.clear();
                vec![self.accept(frame, ahead)]
            }
            (Some(t_us), Some(_)) => self.hold_or_restart(frame, t_us),
            (Some(_), None) => vec![self.accept(frame, ahead)],
            (None, _) if ahead => vec![self.accept(frame, true)],
            (None, _) => {
                self.hold(frame);
                Vec::new()
            }
        }
    }

    /// Telemetry older than the newest: if a second one continues from a first, the board has restarted.
    fn hold_or_restart(&mut self, frame: Frame<Message>, t_us: u64) -> Vec<Message> {
        let follows = |held: &Frame<Message>| match &held.body {
            Message::Telemetry(first) => {
                let steps = frame.sequence.wrapping_sub(held.sequence);
                first.t_us < t_us && (1..u16::MAX / 2).contains(&steps)
            }
            _ => false,
        };
        let restarted = self.held.iter().any(follows);
        self.hold(frame);
        if !restarted {
            return Vec::new();
        }
        self.heard = None;
        self.t_us = None;
        std::mem::take(&mut self.held).into_iter().map(|held| self.accept(held, false)).collect()
    }

    fn hold(&mut self, frame: Frame<Message>) {
        if self.held.len() == MAX_HELD {
            self.held.remove(0);
        }
        self.held.push(frame);
    }

    fn accept(&mut self, frame: Frame<Message>, counts: bool) -> Message {
        if let (Some(heard), true) = (self.heard, counts) {
            self.lost += u32::from(frame.sequence.wrapping_sub(heard).wrapping_sub(1));
        }
        self.heard = Some(frame.sequence);
        if let Message::Telemetry(telemetry) = &frame.body {
            self.t_us = Some(telemetry.t_us);
        }
        frame.body
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use rig_link::EventKind;

    fn telemetry(sequence: u16, t_us: u64) -> Frame<Message> {
        Frame { sequence, body: Message::Telemetry(fixtures::telemetry(t_us)) }
    }

    fn event(sequence: u16) -> Frame<Message> {
        Frame { sequence, body: Message::Event { t_us: 0, kind: EventKind::Stopped } }
    }

    /// The returned messages: times of telemetry (µs), or none for an event.
    fn given(order: &mut Order, frame: Frame<Message>) -> Vec<Option<u64>> {
        let time = |message: Message| if let Message::Telemetry(t) = message { Some(t.t_us) } else { None };
        order.take(frame).into_iter().map(time).collect()
    }

    #[test]
    fn lost_frames_are_counted_by_their_numbers() {
        let lost_of = |first: u16, lost: &[u16]| {
            let mut order = Order::default();
            let numbers = (1..=50).map(|k| first.wrapping_add(k)).filter(|number| !lost.contains(number));
            numbers.for_each(|number| assert_eq!(order.take(event(number)).len(), 1, "{number}"));
            order.lost()
        };
        assert_eq!(lost_of(0, &[]), 0);
        assert_eq!(lost_of(0, &[7, 20, 21, 22]), 4);
        // The numbers come round; the first frame ever heard has nothing before it.
        assert_eq!(lost_of(65_520, &[65_521, 65_535, 0, 3]), 3);
    }

    #[test]
    fn a_frame_that_arrives_twice_is_passed_over() {
        let mut order = Order::default();
        for k in 0..100 {
            assert_eq!(given(&mut order, telemetry(3 * k, 10_000 * u64::from(k))).len(), 1);
            assert_eq!(given(&mut order, event(3 * k + 1)).len(), 1);
            // A telemetry and an event of before, and the same event again.
            if k > 5 {
                assert!(given(&mut order, telemetry(3 * k - 15, 10_000 * u64::from(k - 5))).is_empty());
                assert!(given(&mut order, event(3 * k - 14)).is_empty());
            }
            assert!(given(&mut order, event(3 * k + 1)).is_empty());
        }
        assert_eq!(order.lost(), 99, "one number of three was never used");
    }

    #[test]
    fn all_messages_of_a_restarted_board_are_returned() {
        let mut order = Order::default();
        assert_eq!(given(&mut order, telemetry(5000, 50_000_000)).len(), 1);
        assert!(given(&mut order, event(1)).is_empty());
        assert!(given(&mut order, telemetry(2, 10_000)).is_empty());
        assert!(given(&mut order, event(3)).is_empty());
        assert_eq!(given(&mut order, telemetry(4, 20_000)), [None, Some(10_000), None, Some(20_000)]);
        assert_eq!(given(&mut order, event(5)), [None]);
        // And again, soon after its start.
        assert!(given(&mut order, telemetry(1, 5_000)).is_empty());
        assert_eq!(given(&mut order, telemetry(2, 15_000)), [Some(5_000), Some(15_000)]);
        assert_eq!(order.lost(), 0);
    }

    #[test]
    fn after_a_long_silence_the_number_may_be_any() {
        let mut order = Order::default();
        given(&mut order, telemetry(10, 100_000));
        assert_eq!(given(&mut order, telemetry(40_000, 400_000_000)), [Some(400_000_000)]);
        assert_eq!(given(&mut order, event(40_001)), [None]);
        assert_eq!(order.lost(), 0);
    }
}
