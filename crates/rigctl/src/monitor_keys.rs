//! The keys of the live view: which order each of them gives.
//!
//! Nothing here knows a terminal or a board, so that every key can be tested.

use ratatui::crossterm::event::KeyCode;
use rig_link::{LoadChoice, Request};

/// Steps of the arrow keys (mm), and the one to begin with.
const STEPS_MM: [f64; 4] = [0.1, 0.5, 1.0, 5.0];
const FIRST_STEP: usize = 1;
/// Speed of moves (m/s).
const SPEED_M_PER_S: f32 = 2e-3;
/// Twist speed of a jog (rad/s).
const JOG_RAD_PER_S: f32 = 2.0;
/// How long a jog goes on after the last press of its key (s): a terminal reports no release, and a key that is held down
/// repeats after half a second.
const HELD_S: f64 = 0.7;

/// What a key asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// Send this to the board.
    Send(Request),
    /// Show this to the operator.
    Say(String),
    /// Stop the motion and leave.
    Quit,
}

/// The state of the keyboard.
#[derive(Debug)]
pub struct Keys {
    step: usize,
    /// A target that is being typed (mm).
    typed: Option<String>,
    /// Whether motions are allowed: on a real rig the operator confirms the first one.
    confirmed: bool,
    /// A motion that waits for the confirmation.
    asked: Option<Request>,
    /// The operator has seen the question: what was typed before is no answer to it.
    shown: bool,
    /// When the key of the jog that goes on was pressed last (s).
    jogged_s: Option<f64>,
}

impl Keys {
    /// For a rig on which the first motion needs a confirmation, or an emulated one.
    pub fn new(real: bool) -> Self {
        Self { step: FIRST_STEP, typed: None, confirmed: !real, asked: None, shown: false, jogged_s: None }
    }

    /// The lines of help, or the question that waits for an answer.
    pub fn help(&self) -> [String; 2] {
        if let Some(typed) = &self.typed {
            return [format!("move to (mm): {typed}_"), "Enter moves, Esc cancels, space stops".into()];
        }
        if self.asked.is_some() {
            return ["This moves a real rig. Is the way clear? y: yes, other keys: no".into(), "space stops".into()];
        }
        let step = STEPS_MM[self.step];
        [
            "space stop   h home   c clear fault   q quit (stops first)".into(),
            format!("up/down {step} mm (+/- step)   m to mm   left/right jog"),
        ]
    }

    /// The help was shown to the operator, with the question if there is one.
    pub fn shown(&mut self) {
        self.shown = self.asked.is_some();
    }

    /// The space bar. Nothing comes before the stop: no question, and no text that is being typed.
    pub fn stop(&mut self) -> Order {
        (self.typed, self.asked, self.jogged_s) = (None, None, None);
        Order::Send(Request::Stop)
    }

    /// What a key does at a time (s); `from_m` is the target that is held or approached, or else the position.
    pub fn press(&mut self, key: KeyCode, now_s: f64, from_m: Option<f64>) -> Option<Order> {
        if key == KeyCode::Char(' ') {
            return Some(self.stop());
        }
        if self.asked.is_some() && !self.shown {
            return None;
        }
        if let Some(request) = self.asked.take() {
            self.confirmed = key == KeyCode::Char('y');
            return if self.confirmed { Some(self.send(request, now_s)) } else { say("not moved") };
        }
        if self.typed.is_some() {
            return self.edit(key, now_s);
        }
        match key {
            KeyCode::Char('q') | KeyCode::Esc => Some(Order::Quit),
            KeyCode::Char('c') => Some(Order::Send(Request::Clear)),
            KeyCode::Char('h') => self.motion(Request::Home { load: LoadChoice::Auto }, now_s),
            KeyCode::Char('m') => {
                self.typed = Some(String::new());
                None
            }
            KeyCode::Char('+') => {
                self.step = (self.step + 1).min(STEPS_MM.len() - 1);
                None
            }
            KeyCode::Char('-') => {
                self.step = self.step.saturating_sub(1);
                None
            }
            KeyCode::Up => self.step_to(from_m, 1.0, now_s),
            KeyCode::Down => self.step_to(from_m, -1.0, now_s),
            KeyCode::Right => self.jog(JOG_RAD_PER_S, now_s),
            KeyCode::Left => self.jog(-JOG_RAD_PER_S, now_s),
            _ => None,
        }
    }

    /// The stop of a jog whose key is not pressed any more.
    pub fn released(&mut self, now_s: f64) -> Option<Order> {
        self.jogged_s.take_if(|pressed_s| now_s > *pressed_s + HELD_S)?;
        Some(Order::Send(Request::Stop))
    }

    fn step_to(&mut self, from_m: Option<f64>, way: f64, now_s: f64) -> Option<Order> {
        let Some(from_m) = from_m else { return say("no position yet: home first (h)") };
        self.move_to(from_m + way * STEPS_MM[self.step] * 1e-3, now_s)
    }

    fn move_to(&mut self, target_m: f64, now_s: f64) -> Option<Order> {
        let request = Request::Move { target_m: target_m as f32, speed_m_per_s: SPEED_M_PER_S, load: LoadChoice::Auto };
        self.motion(request, now_s)
    }

    fn jog(&mut self, twist_speed_rad_per_s: f32, now_s: f64) -> Option<Order> {
        self.motion(Request::Jog { twist_speed_rad_per_s }, now_s)
    }

    /// A motion, once the operator has confirmed it.
    fn motion(&mut self, request: Request, now_s: f64) -> Option<Order> {
        if self.confirmed {
            return Some(self.send(request, now_s));
        }
        (self.asked, self.shown) = (Some(request), false);
        None
    }

    fn send(&mut self, request: Request, now_s: f64) -> Order {
        self.jogged_s = matches!(request, Request::Jog { .. }).then_some(now_s);
        Order::Send(request)
    }

    /// A key while a target is typed.
    fn edit(&mut self, key: KeyCode, now_s: f64) -> Option<Order> {
        let mut typed = self.typed.take().unwrap_or_default();
        match key {
            KeyCode::Esc => return say("not moved"),
            KeyCode::Enter => {
                return match typed.parse::<f64>() {
                    Ok(target_mm) if target_mm.is_finite() => self.move_to(target_mm * 1e-3, now_s),
                    _ => say(&format!("`{typed}` is not a number of millimetres")),
                };
            }
            KeyCode::Backspace => drop(typed.pop()),
            KeyCode::Char(digit @ ('0'..='9' | '.' | '-')) if typed.len() < 12 => typed.push(digit),
            _ => {}
        }
        self.typed = Some(typed);
        None
    }
}

fn say(text: &str) -> Option<Order> {
    Some(Order::Say(text.into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use KeyCode::{Backspace, Char, Down, Enter, Esc, Left, Right, Up};

    fn press(keys: &mut Keys, code: KeyCode) -> Option<Order> {
        keys.press(code, 1.0, Some(0.005))
    }

    fn target_mm(order: Option<Order>) -> f64 {
        match order {
            Some(Order::Send(Request::Move { target_m, .. })) => (f64::from(target_m) * 1e6).round() / 1e3,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn each_key_gives_its_order() {
        let keys = &mut Keys::new(false);
        assert_eq!(press(keys, Char('h')), Some(Order::Send(Request::Home { load: LoadChoice::Auto })));
        assert_eq!(press(keys, Char('c')), Some(Order::Send(Request::Clear)));
        assert_eq!(press(keys, Char(' ')), Some(Order::Send(Request::Stop)));
        assert_eq!(press(keys, Char('q')), Some(Order::Quit));
        assert_eq!(press(keys, Char('x')), None);
        assert_eq!(target_mm(press(keys, Up)), 5.5);
        assert_eq!(target_mm(press(keys, Down)), 4.5);
        assert_eq!(press(keys, Char('+')), None);
        assert_eq!(target_mm(press(keys, Up)), 6.0);
        (0..9).for_each(|_| drop(press(keys, Char('-'))));
        assert_eq!(target_mm(press(keys, Up)), 5.1);
        assert!(matches!(keys.press(Up, 1.0, None), Some(Order::Say(text)) if text.contains("home first")));
    }

    #[test]
    fn a_position_is_typed() {
        let keys = &mut Keys::new(false);
        for code in [Char('m'), Char('8'), Char('.'), Char('7'), Backspace, Char('2'), Char('q')] {
            assert_eq!(press(keys, code), None);
        }
        assert!(keys.help()[0].contains("8.2"));
        assert_eq!(target_mm(press(keys, Enter)), 8.2);
        for code in [Char('m'), Char('-'), Char('.')] {
            assert_eq!(press(keys, code), None);
        }
        assert!(matches!(press(keys, Enter), Some(Order::Say(text)) if text.contains("`-.`")));
        press(keys, Char('m'));
        assert!(matches!(press(keys, Esc), Some(Order::Say(_))), "cancels, and does not leave");
        assert_eq!(press(keys, Esc), Some(Order::Quit));
    }

    #[test]
    fn a_jog_ends_when_its_key_is_released() {
        let keys = &mut Keys::new(false);
        let jog = |speed| Some(Order::Send(Request::Jog { twist_speed_rad_per_s: speed }));
        assert_eq!(keys.press(Right, 1.0, None), jog(JOG_RAD_PER_S));
        assert_eq!(keys.press(Left, 1.5, None), jog(-JOG_RAD_PER_S));
        assert_eq!(keys.released(1.5 + HELD_S), None);
        assert_eq!(keys.released(1.6 + HELD_S), Some(Order::Send(Request::Stop)));
        assert_eq!(keys.released(9.0), None, "once");
        keys.press(Right, 10.0, None);
        keys.press(Up, 10.1, Some(0.0));
        assert_eq!(keys.released(19.0), None, "a move has taken its place");
    }

    #[test]
    fn the_first_motion_of_a_real_rig_is_confirmed_and_a_stop_never_waits() {
        let keys = &mut Keys::new(true);
        assert_eq!(press(keys, Char('c')), Some(Order::Send(Request::Clear)), "is no motion");
        assert_eq!(press(keys, Char('h')), None);
        // A pasted sentence, or a key that was pressed too early.
        assert_eq!(press(keys, Char('y')), None, "the question was not shown yet");
        keys.shown();
        assert!(keys.help()[0].contains("real rig"));
        assert!(matches!(press(keys, Char('n')), Some(Order::Say(_))));
        for code in [Char('h'), Up, Right] {
            assert_eq!(press(keys, code), None, "asks again");
            assert_eq!(press(keys, Char(' ')), Some(Order::Send(Request::Stop)));
        }
        assert_eq!(press(keys, Char('y')), None, "there is nothing to confirm");
        press(keys, Up);
        keys.shown();
        assert_eq!(target_mm(press(keys, Char('y'))), 5.5);
        assert_eq!(target_mm(press(keys, Down)), 4.5, "only the first one");
        press(keys, Char('m'));
        assert_eq!(press(keys, Char(' ')), Some(Order::Send(Request::Stop)), "while typing");
    }
}
