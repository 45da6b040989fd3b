//! The live view: the newest telemetry as numbers, the last half minute as plots.

use crate::outline::{Outline, outline};
use crate::session::row::{Row, load_text};
use crate::units::{MA, MM, RAD_PER_MM, RPM, S, TURNS_OF_RAD, UM};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Context, Line as Stroke, Rectangle};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph};
use rig_config::Scene;
use rig_link::{Fault, Limit, State};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Time span of the plots (s).
const SPAN_S: f64 = 30.0;
/// Minimum time between two points of a plot (s).
const POINT_S: f64 = 0.05;
/// Minimum height of a plot: position (mm), load (N).
const MIN_MM: f64 = 0.2;
const MIN_N: f64 = 0.5;
/// Messages that are kept.
const MESSAGES: usize = 4;
/// Columns and lines below which there are numbers only.
const MIN_AREA: [u16; 2] = [60, 20];
/// Lines of the terminal below which the mechanism is not drawn, and lines of its drawing.
const MIN_DRAWN: u16 = 30;
const DRAWN: u16 = 9;
/// Size of the load in the drawing (m).
const LOAD_M: f64 = 6e-3;

#[derive(Clone, Copy)]
struct Point {
    t_s: f64,
    position_mm: Option<f64>,
    setpoint_mm: Option<f64>,
    load_n: Option<f64>,
}

/// A line of a plot: name, colour, time before now (s) and value.
type Series = (&'static str, Color, Vec<(f64, f64)>);

/// The content of the view.
#[derive(Default)]
pub struct Screen {
    title: String,
    /// How long the board has been silent (s), if it is.
    pub silent_s: Option<f64>,
    row: Option<Row>,
    /// When the board came into its present state (s).
    since_s: f64,
    points: VecDeque<Point>,
    messages: VecDeque<String>,
    /// What is drawn; none without a scene that has a mechanism.
    scene: Option<Scene>,
}

impl Screen {
    /// An empty one, which draws the mechanism of a scene.
    pub fn new(title: String, scene: Option<Scene>) -> Self {
        Self { title, scene, ..Self::default() }
    }

    /// Where a step of the load begins: the target that it goes to or is held at, or else its position (m).
    pub fn from_m(&self) -> Option<f64> {
        let row = self.row.as_ref()?;
        row.target_m.or(row.position_m).map(f64::from)
    }

    /// Takes a row.
    pub fn take(&mut self, row: Row) {
        if self.points.back().is_some_and(|last| row.t_s < last.t_s) {
            self.points.clear();
        }
        if self.points.back().is_none_or(|last| row.t_s - last.t_s >= POINT_S) {
            let mm = |v: Option<f32>| v.map(|v| f64::from(v) * 1e3);
            self.points.push_back(Point {
                t_s: row.t_s,
                position_mm: mm(row.position_m),
                setpoint_mm: mm(row.setpoint_m),
                load_n: row.load_n.map(f64::from),
            });
            while self.points.front().is_some_and(|first| row.t_s - first.t_s > SPAN_S) {
                self.points.pop_front();
            }
        }
        if self.row.as_ref().is_none_or(|last| last.state != row.state || row.t_s < last.t_s) {
            self.since_s = row.t_s;
        }
        self.row = Some(row);
    }

    /// Shows a message under the plots.
    pub fn say(&mut self, message: String) {
        self.messages.push_back(message);
        while self.messages.len() > MESSAGES {
            self.messages.pop_front();
        }
    }

    /// Draws all of it, with lines of help.
    pub fn draw(&self, frame: &mut Frame<'_>, help: &[String; 2]) {
        let (bold, area) = (Style::new().add_modifier(Modifier::BOLD), frame.area());
        if area.width < MIN_AREA[0] || area.height < MIN_AREA[1] {
            // No room for plots: the most important lines go first.
            let mut rest = self.numbers();
            let mut lines = rest.split_off(rest.len().min(1));
            lines.insert(lines.len().min(2), Line::styled(help[0].as_str(), bold));
            lines.append(&mut rest);
            frame.render_widget(Paragraph::new(lines), area);
            return;
        }
        let [top, below] = Layout::vertical([Constraint::Min(8), Constraint::Length(MESSAGES as u16 + 4)]).areas(area);
        let [left, right] = Layout::horizontal([Constraint::Length(34), Constraint::Min(20)]).areas(top);
        let drawn = if self.scene.is_some() && area.height >= MIN_DRAWN { DRAWN } else { 0 };
        let [right, mechanism] = Layout::vertical([Constraint::Min(6), Constraint::Length(drawn)]).areas(right);
        let [position, load] = Layout::vertical([Constraint::Percentage(60), Constraint::Percentage(40)]).areas(right);
        self.mechanism(frame, mechanism);
        frame.render_widget(Paragraph::new(self.numbers()).block(Block::bordered().title(self.title.as_str())), left);
        let position_series = [
            ("set-point", Color::Yellow, self.series(|p| p.setpoint_mm)),
            ("position", Color::Cyan, self.series(|p| p.position_mm)),
        ];
        self.plot(frame, position, "position and set-point (mm)", MIN_MM, &position_series);
        self.plot(frame, load, "load (N)", MIN_N, &[("load", Color::Green, self.series(|p| p.load_n))]);
        let mut lines: Vec<Line<'_>> = self.messages.iter().map(|m| Line::from(m.as_str())).collect();
        lines.resize(MESSAGES, Line::default());
        lines.extend(help.iter().map(|line| Line::styled(line.as_str(), bold)));
        frame.render_widget(Paragraph::new(lines).block(Block::bordered()), below);
    }

    /// The mechanism at the twist and the estimated load of the newest row, as the model has it.
    fn mechanism(&self, frame: &mut Frame<'_>, area: Rect) {
        let Some(scene) = self.scene.as_ref().filter(|_| area.height > 2) else { return };
        let shape = self.outline(scene);
        let title = if shape.is_some() { "mechanism (motor left, load right)" } else { "mechanism: shown when homed" };
        let (length_m, half_m) = (scene.geometry.string_length_m, 0.6 * scene.geometry.rod_span_m);
        let canvas = Canvas::default()
            .block(Block::bordered().title(title))
            .x_bounds([-LOAD_M, 1.3 * length_m])
            .y_bounds([-half_m, half_m])
            .marker(Marker::Braille)
            .paint(|context| {
                if let Some(shape) = &shape {
                    paint(shape, context);
                }
            });
        frame.render_widget(canvas, area);
    }

    /// None while load or twist is not known, or where the model has no equilibrium.
    fn outline(&self, scene: &Scene) -> Option<Outline> {
        let row = self.row.as_ref()?;
        let (load_n, twist_rad) = (f64::from(row.load_n?), f64::from(row.twist_rad?).abs());
        let mechanism = scene.mechanism().ok()?;
        outline(scene, &mechanism, &mechanism.solve(load_n, twist_rad).ok()?).ok()
    }

    fn numbers(&self) -> Vec<Line<'_>> {
        let Some(row) = &self.row else { return vec![Line::from("no telemetry yet")] };
        let error_m = row.setpoint_m.zip(row.position_m).map(|(s, p)| f64::from(p) - f64::from(s));
        let twist_rad = row.twist_rad.map(|t| f64::from(t) - PI);
        let bold = Style::new().add_modifier(Modifier::BOLD);
        let alarm = bold.fg(Color::Red);
        let state = match self.silent_s {
            Some(silent_s) => format!("silent {}", S.rounded(silent_s, WHOLE_S)),
            None if row.state == State::Homing => format!("homing {}", S.rounded(row.t_s - self.since_s, WHOLE_S)),
            None => row.state.to_string(),
        };
        let stopped = row.fault.is_some() || row.state == State::EStop || self.silent_s.is_some();
        // A number takes ten columns, and its error and unit stand behind it.
        let line = |name: &'static str, value: String| {
            let (number, rest) = value.split_once(' ').unwrap_or((&value, ""));
            Line::from(format!("{name:<10}{number:>10} {rest}"))
        };
        vec![
            Line::from(vec![
                Span::raw(format!("{:<10}", "state")),
                Span::styled(format!("{state:>10}"), if stopped { alarm } else { bold }),
            ]),
            Line::from(vec![
                Span::raw(format!("{:<10}", "fault")),
                Span::styled(
                    format!("{:>10}", row.fault.map_or("none", Fault::name)),
                    if stopped { alarm } else { Style::new() },
                ),
            ]),
            line("limit", row.limit.map_or("none", Limit::name).to_owned()),
            line("doubts", row.doubts.clone().unwrap_or_else(|| "none".to_owned())),
            line("target", MM.show(row.target_m)),
            line("set-point", MM.show(row.setpoint_m)),
            line("position", MM.within(row.position_m, row.position_error_m)),
            line("error", UM.within(error_m, row.position_error_m)),
            line("time left", S.rounded(row.time_left_s, 1.0)),
            line("load", load_text(row.load_n, row.load_error_n, row.load_at_range_end)),
            line("TR", RAD_PER_MM.show(row.tr_rad_per_m)),
            line("twist", TURNS_OF_RAD.show(twist_rad)),
            line("motor", RPM.rounded(row.drive_speed_rad_per_s, 10.0 * TAU / 60.0)),
            line("current", MA.rounded(row.drive_current_a, 10e-3)),
        ]
    }

    /// The plotted points of one value: time before now (s) and the value.
    fn series(&self, value: impl Fn(&Point) -> Option<f64>) -> Vec<(f64, f64)> {
        let now_s = self.points.back().map_or(0.0, |p| p.t_s);
        self.points.iter().filter_map(|p| Some((p.t_s - now_s, value(p)?))).collect()
    }

    fn plot(&self, frame: &mut Frame<'_>, area: Rect, title: &'static str, min: f64, series: &[Series]) {
        let values = || series.iter().flat_map(|(.., points)| points.iter().map(|(_, v)| *v));
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        let room = 0.5 * (1.1 * (high - low)).max(min);
        let (middle, places) = (0.5 * (low + high), if room < 1.0 { 3 } else { 2 });
        let bounds = [middle - room, middle + room];
        let datasets: Vec<Dataset<'_>> = series
            .iter()
            .map(|(name, colour, points)| {
                let dataset = Dataset::default().name(*name).data(points).marker(Marker::Braille);
                dataset.graph_type(GraphType::Line).style(Style::new().fg(*colour))
            })
            .collect();
        let labels = [bounds[0], middle, bounds[1]].map(|v| format!("{v:.places$}"));
        let chart = Chart::new(datasets)
            .block(Block::bordered().title(title))
            .x_axis(Axis::default().bounds([-SPAN_S, 0.0]).labels(["-30 s", "-15 s", "now"]))
            .y_axis(Axis::default().bounds(bounds).labels(labels));
        frame.render_widget(chart, area);
    }
}

/// To this (s) a waiting time is shown.
const WHOLE_S: f64 = 10.0;

/// Draws rods, strings and the load.
fn paint(shape: &Outline, context: &mut Context<'_>) {
    let lines = shape.rods.iter().map(|rod| (rod, Color::Blue)).chain(shape.strings.iter().map(|s| (s, Color::Yellow)));
    for (points, colour) in lines {
        for pair in points.windows(2) {
            context.draw(&Stroke::new(pair[0][0], pair[0][1], pair[1][0], pair[1][1], colour));
        }
    }
    let (x, y) = (shape.gap_m, -0.5 * LOAD_M);
    context.draw(&Rectangle { x, y, width: LOAD_M, height: LOAD_M, color: Color::Green });
    context.print(shape.gap_m + 1.5 * LOAD_M, 0.0, "load");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use rig_link::{Faults, Telemetry};

    fn row(t_s: f64, position_m: f32, fault: Option<Fault>) -> Row {
        let telemetry = Telemetry {
            state: if fault.is_some() { State::Fault } else { State::Moving },
            fault,
            faults: fault.map_or(Faults::NONE, |fault| Faults::NONE.with(fault)),
            target_m: Some(0.012),
            setpoint_m: Some(0.005),
            position_m: Some(position_m),
            twist_rad: Some(12.0),
            load_n: Some(4.9),
            load_error_n: Some(0.21),
            position_error_m: Some(0.13e-3),
            tr_rad_per_m: Some(2500.0),
            drive_current_a: 0.1,
            drive_speed_rad_per_s: 104.72,
            time_left_s: Some(3.0),
            ..fixtures::telemetry((t_s * 1e6) as u64)
        };
        Row::new(t_s, &telemetry, None, None)
    }

    fn drawn(screen: &Screen, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        let help = ["space stop".to_owned(), "up/down".to_owned()];
        terminal.draw(|frame| screen.draw(frame, &help)).unwrap();
        format!("{}", terminal.backend())
    }

    #[test]
    fn the_mechanism_is_drawn_and_shortens_with_twist() {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/default.toml");
        let mut screen = Screen::new("sim".into(), Some(Scene::load(scene).unwrap()));
        assert!(drawn(&screen, 120, 40).contains("shown when homed"));
        let mut load_at = |twist_rad: f32| {
            let mut told = row(1.0, 0.0, None);
            told.twist_rad = Some(twist_rad);
            screen.take(told);
            let text = drawn(&screen, 120, 40);
            assert!(text.contains("motor left"), "{text}");
            // The load's label is farther right than any other.
            let column = |line: &str| Some(line[..line.rfind("load")?].chars().count());
            text.lines().filter_map(column).max().unwrap()
        };
        let (short, long) = (load_at(40.0), load_at(3.2));
        assert!(short < long, "{short} {long}");
        // A state that the model refuses is not drawn.
        let mut told = row(1.0, 0.0, None);
        told.twist_rad = Some(1e4);
        screen.take(told);
        assert!(drawn(&screen, 120, 40).contains("shown when homed"));
        assert!(!drawn(&screen, 120, 25).contains("mechanism"));
    }

    #[test]
    fn everything_is_on_the_screen() {
        let mut screen = Screen::new("sim".into(), None);
        for k in 0..400 {
            screen.take(row(0.1 * f64::from(k), 0.0045, None));
        }
        screen.take(row(40.0, 0.0045, Some(Fault::LvdtOpen)));
        screen.say("script line 3: refused".into());
        let text = drawn(&screen, 100, 34);
        for seen in [
            "lvdt-open",
            "4.50 ± 0.13 mm",
            "12.00 mm",
            "-500 ± 130 µm",
            "4.90 ± 0.21 N",
            "2.500 rad/mm",
            "1000 rpm",
            "line 3",
            "space stop",
            "now",
        ] {
            assert!(text.contains(seen), "{seen} in\n{text}");
        }
        let small = drawn(&screen, 36, 5);
        assert!(small.contains("lvdt-open") && small.contains("space stop"), "{small}");
        // Half a minute, not more; and a board that restarts begins again.
        assert!(screen.points.len() <= 601 && screen.points[0].t_s >= 10.0);
        screen.take(row(0.1, 0.0, None));
        assert_eq!(screen.points.len(), 1);
    }

    #[test]
    fn a_terminal_of_80_by_24_shows_every_number() {
        let mut screen = Screen::new("sim".into(), None);
        screen.take(row(40.0, 0.0045, None));
        let text = drawn(&screen, 80, 24);
        for seen in [
            "state",
            "4.50 ± 0.13 mm",
            "-500 ± 130 µm",
            "4.90 ± 0.21 N",
            "2.500 rad/mm",
            "1.410 turns",
            "1000 rpm",
            "100 mA",
            "space stop",
        ] {
            assert!(text.contains(seen), "{seen} in\n{text}");
        }
        for t_s in [41.0, 53.2] {
            screen.take(Row { state: State::Homing, ..row(t_s, 0.0, None) });
        }
        assert!(drawn(&screen, 80, 24).contains("homing 12 s"), "how long it has homed");
    }

    #[test]
    fn a_tiny_or_empty_screen_is_drawn_all_the_same() {
        for (width, height) in [(1, 1), (10, 3), (40, 10), (200, 60)] {
            drawn(&Screen::default(), width, height);
        }
    }
}
