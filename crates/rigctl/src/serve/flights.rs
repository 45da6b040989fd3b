//! Orders that were given to the board and have not ended. The board replies to each; one that has begun a motion ends with
//! an event.

use crate::failure::Refused;
use crate::output::decimal;
use crate::session::motion::end_of;
use rig_link::{Accepted, EventKind, Refusal, Request, State};
use serde_json::{Value, json};

/// How long the board may be at rest before a motion counts as ended although its event did not come (s).
const REST_S: f64 = 0.2;

/// An order that has not ended.
struct Flight {
    /// The client that gave it.
    client: u64,
    id: Option<Value>,
    /// Number of its request.
    number: u16,
    request: Request,
    /// When it was sent, or the board last reported its motion (s).
    since_s: f64,
    /// Whether the board has accepted it and has begun a motion.
    moves: bool,
}

/// The end of an order.
#[derive(Debug, Clone, PartialEq)]
pub struct Landed {
    /// The client that gave it.
    pub client: u64,
    /// As it gave it.
    pub id: Option<Value>,
    /// What came of it.
    pub result: Result<Value, Refused>,
}

/// Orders that have not ended, the oldest first.
#[derive(Default)]
pub struct Flights {
    flights: Vec<Flight>,
    landed: Vec<Landed>,
}

impl Flights {
    /// An order was sent to the board under this number.
    pub fn start(&mut self, client: u64, id: Option<Value>, number: u16, request: Request, now_s: f64) {
        self.flights.push(Flight { client, id, number, request, since_s: now_s, moves: false });
    }

    /// Whether an order of this client has not ended.
    pub fn any_of(&self, client: u64) -> bool {
        self.flights.iter().any(|flight| flight.client == client)
    }

    /// The orders that have ended since the last call.
    pub fn take(&mut self) -> Vec<Landed> {
        std::mem::take(&mut self.landed)
    }

    /// The board has replied to a request.
    pub fn reply(&mut self, number: u16, result: Result<Accepted, Refusal>, now_s: f64) {
        match result {
            Ok(Accepted::Started) => {
                // A motion that is given again takes the place of the one before. A set-point of a stream has no end of its own.
                let known = self.flights.iter().any(|flight| flight.number == number);
                self.end(|flight| match &flight.request {
                    Request::Track { .. } if flight.number == number => Some(Ok(json!({}))),
                    _ => (known && flight.moves)
                        .then(|| Err(Refused::new("replaced", "a later order has taken its place"))),
                });
                if let Some(flight) = self.flights.iter_mut().find(|flight| flight.number == number) {
                    (flight.moves, flight.since_s) = (true, now_s);
                }
            }
            result => self.end(|flight| {
                let refused = |refusal: &Refusal| Refused::new("refused", refusal.to_string());
                (flight.number == number).then(|| result.as_ref().map(|_| json!({})).map_err(refused))
            }),
        }
    }

    /// The board has reported an event.
    pub fn event(&mut self, event: &EventKind) {
        let done = match event {
            EventKind::Homed(found) => {
                json!({"load_n": decimal(found.load_n), "load_error_n": decimal(found.load_error_n),
                "friction_n": decimal(found.friction_n), "zero_error_rad": decimal(found.zero_error_rad)})
            }
            EventKind::MoveDone { error_m } => json!({"error_m": decimal(*error_m)}),
            _ => json!({}),
        };
        self.end(|flight| {
            let end = end_of(&flight.request, event).filter(|_| flight.moves)?;
            Some(end.map(|()| done.clone()).map_err(|cut| Refused::new(cut.kind(), cut.to_string())))
        });
    }

    /// Time has passed: a lost reply or event does not leave an order open indefinitely. `reply_s` is the longest wait for a reply.
    pub fn pass(&mut self, state: State, now_s: f64, reply_s: f64) {
        if matches!(state, State::Moving | State::Homing) {
            self.flights.iter_mut().filter(|flight| flight.moves).for_each(|flight| flight.since_s = now_s);
        }
        self.end(|flight| match flight.moves {
            false if now_s > flight.since_s + reply_s => {
                Some(Err(Refused::new("no-reply", format!("no reply from the board within {reply_s} s"))))
            }
            true if now_s > flight.since_s + REST_S => {
                Some(Err(Refused::new("stopped", format!("the board has ended it: it is {state}"))))
            }
            _ => None,
        });
    }

    /// Nobody hears of their ends any more: the conversation with the board has ended, or the board is silent.
    pub fn end_all(&mut self, kind: &'static str, why: &str) {
        self.end(|_| Some(Err(Refused::new(kind, why))));
    }

    /// Ends the orders that have a result.
    fn end(&mut self, result: impl Fn(&Flight) -> Option<Result<Value, Refused>>) {
        for flight in std::mem::take(&mut self.flights) {
            match result(&flight) {
                Some(result) => self.landed.push(Landed { client: flight.client, id: flight.id, result }),
                None => self.flights.push(flight),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_link::Fault;

    const REPLY_S: f64 = 3.0;

    const MOVE: Request = Request::Move { target_m: 0.01, speed_m_per_s: 0.002, load: rig_link::LoadChoice::Auto };

    /// Ids and results, an error by its kind.
    fn landed(flights: &mut Flights) -> Vec<(u64, Result<Value, &'static str>)> {
        let id = |one: &Landed| one.id.as_ref().and_then(Value::as_u64).expect("an id");
        flights.take().into_iter().map(|one| (id(&one), one.result.map_err(|refused| refused.kind))).collect()
    }

    /// Orders of one client, whose ids are their numbers, sent at 0 s; those that start a motion have started.
    fn flying(orders: &[(u16, Request, Option<Accepted>)]) -> Flights {
        let mut flights = Flights::default();
        for (number, request, reply) in orders {
            flights.start(1, Some((*number).into()), *number, *request, 0.0);
            if let Some(reply) = reply {
                flights.reply(*number, Ok(*reply), 0.0);
            }
        }
        flights
    }

    #[test]
    fn a_reply_ends_what_is_done_at_once_and_an_event_what_moves() {
        let mut flights = flying(&[(1, Request::Clear, Some(Accepted::Done)), (2, MOVE, Some(Accepted::Started))]);
        assert_eq!(landed(&mut flights), [(1, Ok(json!({})))]);
        assert!(flights.any_of(1) && !flights.any_of(2));
        flights.event(&EventKind::MoveDone { error_m: 0.5 });
        assert_eq!(landed(&mut flights), [(2, Ok(json!({"error_m": 0.5})))]);
        assert!(!flights.any_of(1));
    }

    #[test]
    fn whatever_ends_a_motion_ends_its_order() {
        for (kind, named) in [
            (EventKind::Stopped, "stopped"),
            (EventKind::FaultRaised(Fault::DriveStall), "fault"),
            (EventKind::EStopOpened, "estop"),
            (EventKind::HomingRefused(rig_link::HomingFailure::PoorFit), "homing-failed"),
        ] {
            let mut flights = flying(&[(1, Request::HOME, Some(Accepted::Started))]);
            flights.event(&EventKind::FaultCleared(Fault::DriveStall));
            assert!(landed(&mut flights).is_empty());
            flights.event(&kind);
            assert_eq!(landed(&mut flights), [(1, Err(named))], "{kind:?}");
        }
        let mut flights = flying(&[(1, MOVE, Some(Accepted::Started)), (2, MOVE, Some(Accepted::Started))]);
        assert_eq!(landed(&mut flights), [(1, Err("replaced"))]);
        flights.reply(2, Err(Refusal::TooMany), 0.0);
        assert_eq!(landed(&mut flights), [(2, Err("refused"))]);
        let jog = Request::Jog { twist_speed_rad_per_s: 1.0 };
        let mut flights = flying(&[(1, jog, Some(Accepted::Started))]);
        flights.event(&EventKind::Stopped);
        assert_eq!(landed(&mut flights), [(1, Ok(json!({})))], "a jog has no other end");
    }

    #[test]
    fn a_set_point_ends_with_its_reply_and_takes_the_place_of_a_move() {
        let point = Request::Track { position_m: 0.01, speed_m_per_s: 0.0, for_s: 0.2 };
        let mut flights = flying(&[(1, MOVE, Some(Accepted::Started)), (2, point, Some(Accepted::Started))]);
        assert_eq!(landed(&mut flights), [(1, Err("replaced")), (2, Ok(json!({})))]);
        assert!(!flights.any_of(1));
    }

    #[test]
    fn a_lost_reply_or_event_leaves_nothing_open() {
        let mut flights = flying(&[(1, MOVE, Some(Accepted::Started)), (2, Request::Clear, None)]);
        flights.pass(State::Moving, REPLY_S - 0.1, REPLY_S);
        assert!(landed(&mut flights).is_empty());
        flights.pass(State::Moving, REPLY_S + 0.1, REPLY_S);
        assert_eq!(landed(&mut flights), [(2, Err("no-reply"))]);
        flights.pass(State::Holding, REPLY_S + 0.2, REPLY_S);
        assert!(landed(&mut flights).is_empty(), "its event may still be on the way");
        flights.pass(State::Holding, REPLY_S + 0.4, REPLY_S);
        assert_eq!(landed(&mut flights), [(1, Err("stopped"))]);
    }
}
