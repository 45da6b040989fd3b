//! `home`, `move`, `track`, `jog`, `stop`, `clear`: what moves the rig, or stops it.

use super::dry_run;
use crate::failure::Failure;
use crate::options::Global;
use crate::options::values::{of, speed_or_max};
use crate::output::Output;
use crate::plan::Plan;
use crate::request::load_choice;
use crate::session::row::load_text;
use crate::session::{Session, Target, Wanted, homing, motion, stream};
use crate::trajectory::Trajectory;
use crate::units::{MM, Quantity, RAD_PER_MM, S, TURNS, UM};
use clap::Args;
use rig_control::move_check::MoveRequest;
use rig_link::{LoadChoice, Request};
use std::path::{Path, PathBuf};

/// Find zero twist, estimate the load, stop at the half-turn pre-twist
///
/// From any twist at power-up, in 45 s at most: looks for the maximum gap, turns across it, then six turns up and down.
/// That lifts the load by 10 to 23 mm (default scene): leave it room. Position 0 is where it hangs at the end.
/// Example: `rigctl home --load 0.5kg`
#[derive(Debug, Args)]
pub struct Home {
    /// `auto` (the board weighs the load) or the load as you weighed it
    #[arg(long, value_name = "auto|L", default_value = "auto", allow_hyphen_values = true, value_parser = load_choice)]
    load: LoadChoice,
}

impl Home {
    /// Runs the command.
    ///
    /// # Errors
    /// The board's refusal or failure in words.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let mut session = global.target()?.connect(Wanted::OfScene)?;
        let result = homing::home(&mut session, self.load, |_| {})?;
        output.object(&result)?;
        Ok(output.line(result.text())?)
    }
}

/// Move the load to a position, measured from where it hung when homed
///
/// Ends with the measured error at rest. What holds a move back (the motor's speed, acceleration or current) is shown as
/// `limit`; a target out of reach is refused with the range that is in reach. On an emulated board it homes first.
/// Example: `rigctl move --to 8mm --speed 2mm/s`
#[derive(Debug, Args)]
pub struct Move {
    /// Target position (m, mm, µm)
    #[arg(long, value_name = "P", allow_hyphen_values = true, value_parser = of("to", Quantity::Length))]
    pub(super) to: f64,
    /// Speed of the load (m/s, mm/s), or `max`: as fast as the motor allows under this load
    #[arg(long, value_name = "V|max", default_value = "2mm/s", allow_hyphen_values = true, value_parser = speed_or_max)]
    pub(super) speed: f64,
    /// `auto` (the board's own estimate) or a load
    #[arg(long, value_name = "auto|L", default_value = "auto", allow_hyphen_values = true, value_parser = load_choice)]
    pub(super) load: LoadChoice,
    /// Print the planned trajectory and the table's answers, without a device; needs a load
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// With --dry-run: the settings of a board, in a file of `config backup` or a log [default: a new board's]
    #[arg(long, value_name = "FILE", requires = "dry_run")]
    pub(super) settings: Option<PathBuf>,
}

impl Move {
    /// Runs the command.
    ///
    /// # Errors
    /// The board's refusal or failure in words.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        if self.dry_run {
            return dry_run::run(global, self, output);
        }
        let mut session = global.target()?.connect(Wanted::OfScene)?;
        if global.is_emulated() {
            let load_n = if let LoadChoice::Known(load_n) = self.load { Some(load_n) } else { None };
            let request =
                MoveRequest { target_m: self.to as f32, speed_m_per_s: self.speed as f32, load: LoadChoice::Auto };
            let values = session.settings()?.values;
            Plan::new(&global.scene()?, values, load_n)?.check_move(&request.with_speed_max(&values))?;
            home_first(&mut session, self.load, output)?;
        }
        let r = motion::move_to(&mut session, self.to, self.speed, self.load, |_| {})?;
        output.object(&r)?;
        let lines = [
            ("target", MM.exact(r.target_m)),
            ("measured", MM.within(r.position_m, r.position_error_m)),
            ("error", UM.within(r.error_m, r.position_error_m)),
            ("true error", r.true_error_m.map_or(String::new(), |m| UM.rounded(m, r.position_error_m) + " (emulated)")),
            ("load", load_text(r.load_n, r.load_error_n, r.load_at_range_end)),
            (
                "TR",
                format!(
                    "{} to {}",
                    RAD_PER_MM.number(r.tr_start_rad_per_m, None::<f64>),
                    RAD_PER_MM.show(r.tr_end_rad_per_m)
                ),
            ),
            ("strings", TURNS.show(r.turns)),
            ("time", S.show(r.duration_s)),
            ("off target", r.off_target.clone().unwrap_or_default()),
        ];
        Ok(output.named(lines)?)
    }
}

/// Homes an emulated board, which starts afresh.
pub(super) fn home_first(session: &mut Session, load: LoadChoice, output: &mut Output) -> Result<(), Failure> {
    crate::output::say!("the emulated board starts afresh and is not homed: homing first");
    Ok(output.line(homing::home(session, load, |_| {})?.text())?)
}

/// Follow a trajectory from a CSV file
///
/// The file has the columns `t_s`, `position_m` and optionally `speed_m_per_s`; the load first moves to where it begins. Range,
/// speed and acceleration of the whole trajectory are checked before the load moves, and the refusal names the row.
/// A set-point is sent every 20 ms. The board follows within the motor's limits (`limit` says when they hold it back), and
/// ends in a hold when the next one is 0.2 s late, out of reach, or half a second of full speed ahead of the load. On an
/// emulated board it homes first.
/// Example: `rigctl track scenarios/sine.csv`
#[derive(Debug, Args)]
pub struct Track {
    /// The trajectory; `-` is standard input
    file: PathBuf,
}

impl Track {
    /// Runs the command.
    ///
    /// # Errors
    /// What is wrong with the file, or the board's refusal, or why it ended the stream, in words.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let (name, trajectory) = if self.file == Path::new("-") {
            let trajectory = std::io::read_to_string(std::io::stdin()).map_err(|e| e.to_string());
            let trajectory = trajectory.and_then(|text| Trajectory::parse(&text));
            let name = "standard input".to_owned();
            (name.clone(), trajectory.map_err(|e| Failure::failed(format!("{name}: {e}")))?)
        } else {
            (format!("trajectory file {}", self.file.display()), Trajectory::load(&self.file)?)
        };
        let scene = global.scene()?;
        let mut session = global.target()?.connect(Wanted::OfScene)?;
        let values = session.settings()?.values;
        let possible = |load_n| {
            let checked = Plan::new(&scene, values, load_n)?.check_trajectory(&trajectory);
            checked.map_err(|(line, why)| Failure::failed(format!("{name}: line {line}: {why}")))
        };
        // What no load can follow is refused before an emulated board is homed; what this one cannot, before it moves further.
        if global.is_emulated() {
            possible(None)?;
            home_first(&mut session, LoadChoice::Auto, output)?;
        }
        possible(session.newest_row()?.and_then(|row| row.load_n))?;
        let r = stream::track(&mut session, &trajectory, |_| {})?;
        output.object(&r)?;
        let lines = [
            ("trajectory", S.show(r.duration_s)),
            (
                "error",
                format!("{} rms, {} at most (measured)", UM.show(r.following_rms_m), UM.show(r.following_most_m)),
            ),
            ("true error", r.true_following_rms_m.map_or(String::new(), |m| UM.show(m) + " rms (emulated)")),
            ("limit", r.limit_text()),
            ("at rest", UM.show(r.error_m) + " from its end"),
        ];
        Ok(output.named(lines)?)
    }
}

/// Turn the strings at a constant speed for a time, homed or not
///
/// Example: `rigctl jog --speed 2rad/s --seconds 1.5s`
#[derive(Debug, Args)]
pub struct Jog {
    /// Twist speed (rad/s, deg/s, rpm of the strings), positive twists up
    #[arg(long, value_name = "W", allow_hyphen_values = true, value_parser = of("speed", Quantity::AngularSpeed))]
    speed: f64,
    /// How long (s)
    #[arg(long, value_name = "S", default_value = "1s", allow_hyphen_values = true, value_parser = of("seconds", Quantity::Time))]
    seconds: f64,
}

impl Jog {
    /// Runs the command.
    ///
    /// # Errors
    /// The board's refusal or failure in words.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        if !(0.0..=600.0).contains(&self.seconds) {
            return Err(Failure::Usage(format!("--seconds {}: must be from 0 to 600", S.exact(self.seconds))));
        }
        let mut session = global.target()?.connect(Wanted::OfScene)?;
        motion::jog(&mut session, self.speed, self.seconds)?;
        newest_row(&mut session, output)
    }
}

/// `stop`, `hold`, `clear`: one request to any board, whatever scene it is for, in any fault.
///
/// # Errors
/// The board's refusal in words.
pub fn request(global: &Global, request: &Request, output: &mut Output) -> Result<(), Failure> {
    // Who forgets the port must not take its answer for that of the rig.
    if global.port.is_none() && global.is_emulated() {
        output.line("no --port: this goes to an emulated board that starts with the command, and to NO rig")?;
    }
    let mut session = any_board(&global.target()?)?;
    session.request(request)?;
    session.until(0.2, |_| false)?;
    newest_row(&mut session, output)
}

/// Any board, in any state; an emulated one that has started.
pub(super) fn any_board(target: &Target) -> Result<Session, Failure> {
    let mut session = target.connect(Wanted::Any)?;
    if target.emulated().is_some() {
        session.wait_started()?;
    }
    Ok(session)
}

fn newest_row(session: &mut Session, output: &mut Output) -> Result<(), Failure> {
    let Some(row) = session.newest_row()? else { return Ok(()) };
    output.object(&row)?;
    Ok(output.line(row.text())?)
}
