//! `monitor`: the live view.

use crate::failure::Failure;
use crate::log::write::event;
use crate::monitor_input::{self, Typed};
use crate::monitor_keys::{Keys, Order};
use crate::options::Global;
use crate::output::{Output, at};
use crate::play::play;
use crate::request::text;
use crate::screen::Screen;
use crate::script::Script;
use crate::session::row::load_text;
use crate::session::{Place, Session, Wanted};
use clap::Args;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{DisableBracketedPaste, EnableBracketedPaste};
use ratatui::crossterm::execute;
use rig_link::{EventKind, Request, State};
use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Time between two pictures (s).
const PICTURE_S: f64 = 0.05;
/// Longest wait for a motion to end before leaving (s).
const LEAVE_S: f64 = 10.0;
/// Minimum time that a stop before leaving is given to reach the board and its telemetry (s).
const STOPPING_S: f64 = 0.2;
/// The view does not end with its script.
const FOR_EVER_S: f64 = 1e9;

/// Gives the terminal back, whatever happens.
struct Restored(DefaultTerminal);

impl Drop for Restored {
    fn drop(&mut self) {
        let _ = execute!(std::io::stdout(), DisableBracketedPaste);
        ratatui::restore();
    }
}

/// Show and move the actuator live in the terminal
///
/// It shows state, position, load, TR, motor and faults, and draws the mechanism.
///
/// Keys: space stops, at any time. h homes, up and down move by a step (+ and - change it), m asks for a position, left and
/// right jog while they are held, c clears a fault, q leaves and stops a motion first. The first motion of a real rig
/// asks for a confirmation. On an emulated board time passes as on a real one.
#[derive(Debug, Args)]
pub struct Monitor {
    /// Play this script meanwhile (format as for `play`)
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// Without a terminal, if nobody answers, or the port fails.
pub fn run(global: &Global, Monitor { script }: &Monitor, output: &Output) -> Result<(), Failure> {
    if output.json() {
        return Err(Failure::Usage("monitor has no --json: `record --json` prints telemetry".into()));
    }
    if !(std::io::stdin().is_terminal() && std::io::stdout().is_terminal()) {
        return Err(Failure::failed("monitor needs a terminal; `record` and `status` do not"));
    }
    let mut script = match script {
        Some(path) => Script::load(path)?.0,
        None => Script::idle(FOR_EVER_S),
    };
    script.end_s = FOR_EVER_S;
    let target = global.target()?;
    let mut session = target.connect(Wanted::Any)?;
    let title = match &target.place {
        Place::Emulated(options) => format!(" {options} "),
        Place::Device(device) => format!(" rig at {device} "),
    };
    // A scene without a mechanism is not drawn; the check below tells if it is another than the board's.
    let scene = global.scene().ok();
    let keys = Keys::new(!global.is_emulated());
    // A board that is heard again is shown again.
    (session.bears_silence, session.bears_reset) = (true, true);
    let mut view = View {
        screen: Screen::new(title, scene),
        input: monitor_input::Terminal::start(),
        keys,
        leaving: None,
        ordered: false,
        drawn_s: f64::MIN,
    };
    if let Some(warning) = target.check_scene(&session).err().and_then(|failure| failure.message()) {
        view.screen.say(warning);
    }
    // It also gives the terminal back if the tool panics.
    let mut terminal = Restored(ratatui::try_init()?);
    // What is pasted arrives marked, where the terminal knows how.
    execute!(std::io::stdout(), EnableBracketedPaste)?;
    let (started, start_s, paced) = (Instant::now(), session.now_s(), global.is_emulated());
    let result = play(&mut session, &script, global.board.seed, |session, messages| {
        messages.into_iter().for_each(|line| view.screen.say(line));
        if paced {
            // Emulated time may run ahead; it may also be slower than real time, then nothing waits.
            let ahead_s = session.now_s() - start_s - started.elapsed().as_secs_f64();
            std::thread::sleep(Duration::from_secs_f64(ahead_s.max(0.0)));
        }
        view.step(session, &mut terminal.0)
    });
    drop(terminal);
    if let Some(false) = view.leaving.map(|_| still(&session)) {
        crate::output::say!(
            "left while the rig still moved: without this tool's heartbeat the board holds within 0.5 s"
        );
    }
    result?;
    if session.silent_s().is_some() {
        return Err(Failure::failed("left while the board was silent: whether the rig stands still is not known"));
    }
    Ok(())
}

fn still(session: &Session) -> bool {
    session.silent_s().is_none()
        && !session.telemetry().is_some_and(|t| matches!(t.state, State::Moving | State::Homing))
}

struct View {
    screen: Screen,
    input: monitor_input::Terminal,
    keys: Keys,
    /// Whether the operator has moved the rig from here.
    ordered: bool,
    /// When the operator wanted to leave (s).
    leaving: Option<f64>,
    drawn_s: f64,
}

impl View {
    fn step(&mut self, session: &mut Session, terminal: &mut DefaultTerminal) -> Result<ControlFlow<()>, Failure> {
        for row in session.take_rows() {
            self.screen.take(row);
        }
        for (t_s, kind) in session.take_events() {
            let what = match kind {
                EventKind::Homed(found) => {
                    let end = session.range_end(found.load_n);
                    format!("homed: load {}", load_text(found.load_n, found.load_error_n, end))
                }
                _ => event(&kind),
            };
            self.screen.say(format!("{}  {what}", at(t_s)));
        }
        session.take_log();
        self.screen.silent_s = session.silent_s();
        self.typed(session)?;
        if let Some(order) = self.keys.released(session.now_s()) {
            self.obey(order, session)?;
        }
        if session.now_s() >= self.drawn_s + PICTURE_S {
            self.drawn_s = session.now_s();
            let help = self.keys.help();
            terminal.draw(|frame| self.screen.draw(frame, &help))?;
            self.keys.shown();
        }
        let leave = self.leaving.is_some_and(|since_s| {
            let waited_s = session.now_s() - since_s;
            (still(session) && (waited_s > STOPPING_S || !self.ordered)) || waited_s > LEAVE_S
        });
        Ok(if leave { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }

    /// Does what was typed. A stop is done before everything else.
    fn typed(&mut self, session: &mut Session) -> Result<(), Failure> {
        match self.input.typed()? {
            Typed::Leave => self.leave(session),
            Typed::Stop => {
                let order = self.keys.stop();
                self.obey(order, session)
            }
            Typed::Keys(keys, pasted) => {
                if pasted {
                    self.screen.say(format!("{}  pasted text is ignored", at(session.now_s())));
                }
                keys.into_iter().try_for_each(|key| {
                    let order = self.keys.press(key, session.now_s(), self.screen.from_m());
                    order.map_or(Ok(()), |order| self.obey(order, session))
                })
            }
        }
    }

    fn obey(&mut self, order: Order, session: &mut Session) -> Result<(), Failure> {
        match order {
            Order::Quit => return self.leave(session),
            Order::Say(text) => self.screen.say(format!("{}  {text}", at(session.now_s()))),
            // On the way out nothing moves any more.
            Order::Send(request) if self.leaving.is_none() || request == Request::Stop => {
                self.ordered = true;
                session.post(&request)?;
                let what = text(&request).unwrap_or_default();
                self.screen.say(format!("{}  you: {what}", at(session.now_s())));
            }
            Order::Send(_) => {}
        }
        Ok(())
    }

    fn leave(&mut self, session: &mut Session) -> Result<(), Failure> {
        // A motion that was ordered just now is not in the telemetry yet.
        if self.leaving.is_none() && (self.ordered || !still(session)) {
            session.post(&Request::Stop)?;
            self.screen.say(format!("{}  stopping the motion before leaving", at(session.now_s())));
        }
        self.leaving.get_or_insert(session.now_s());
        Ok(())
    }
}
