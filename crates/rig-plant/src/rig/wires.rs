//! What the chip's pins are wired to.

use super::lvdt::volts_to_code;
use super::{EmulatedRig, HOST_USART, SAME_TIME_S, STEP_S, STEPS_PER_TICK};
use crate::board::{Board, CanFrame, CanOutcome, Stimulus};
use rmds405::{Frame, Received, Transport, serial};

/// USART of the drive's serial line (docs/reference/hardware.md 3).
const DRIVE_USART: u8 = 1;
/// Motor-power relay, PB10: low is off (docs/reference/hardware.md 3).
const RELAY: (char, u8) = ('B', 10);

/// E-stop sense, PB5: high is stop.
const ESTOP: (char, u8) = ('B', 5);
/// Lower and upper limit switch, PC7 and PA8: normally closed to ground, high is open.
const LIMIT_LOW: (char, u8) = ('C', 7);
const LIMIT_HIGH: (char, u8) = ('A', 8);
/// Acknowledge button, PC13: active low.
const BUTTON: (char, u8) = ('C', 13);
/// The limit switches open this far before the ends of the rail, m. Assumed.
const LIMIT_MARGIN_M: f64 = 2e-3;
/// Divided LVDT excitation on ADC channel 1, V. Assumed.
const EXCITATION_V: f64 = 3.0;
/// Internal reference on ADC channel 17, V (typical value of the STM32F446 data sheet).
const VREFINT_V: f64 = 1.21;

impl EmulatedRig {
    /// Drives every pin again: after power-up the microcontroller knows none of the levels.
    pub(super) fn drive_all_pins(&mut self) {
        self.pins.clear();
        self.set_pin(BUTTON, true);
        self.look_at_pins();
    }

    /// Drives the pins whose level has changed.
    pub(super) fn look_at_pins(&mut self) {
        let [upper, lower] = self.stops_m;
        let gap_m = self.plant.gap_m();
        self.set_pin(ESTOP, self.estop);
        self.set_pin(LIMIT_LOW, gap_m > lower - LIMIT_MARGIN_M);
        self.set_pin(LIMIT_HIGH, self.limit_fault || gap_m < upper + LIMIT_MARGIN_M);
    }

    fn set_pin(&mut self, (port, pin): (char, u8), high: bool) {
        let known = self.pins.iter_mut().find(|(p, n, _)| (*p, *n) == (port, pin));
        match known {
            Some((_, _, level)) if *level == high => return,
            Some((_, _, level)) => *level = high,
            None => self.pins.push((port, pin, high)),
        }
        self.pending.push(Stimulus::Pin { port, pin, high });
    }

    /// Puts the drive's reports on its line.
    pub(super) fn collect_reports(&mut self) {
        for (at_s, frame) in self.drive.take_sent() {
            // It sends nothing before it has received a frame, which decides the line.
            let sent = match self.drive.transport() {
                Some(Transport::Can) if !self.can_shorted => Stimulus::Can(can_frame(&frame)),
                Some(Transport::Uart) => Stimulus::Uart { usart: DRIVE_USART, bytes: serial::encode(&frame).to_vec() },
                _ => continue,
            };
            if !self.silent {
                self.from_drive.push_back((at_s, sent));
            }
        }
    }
}

fn can_frame(frame: &Frame) -> CanFrame {
    CanFrame { id: u32::from(frame.id), extended: false, remote: false, dlc: 8, data: frame.data }
}

impl Board for EmulatedRig {
    fn adc(&mut self, t_s: f64, channel: u8) -> u16 {
        self.advance(t_s);
        let reference_v = self.parameters.adc_reference_v;
        match channel {
            0 => self.lvdt.sample(&mut self.noise),
            1 => volts_to_code(EXCITATION_V, reference_v),
            17 => volts_to_code(VREFINT_V, reference_v),
            _ => 0,
        }
    }

    fn uart_tx(&mut self, t_s: f64, usart: u8, byte: u8) {
        match usart {
            HOST_USART => self.host_bytes.push(byte),
            DRIVE_USART if !self.silent => {
                self.advance(t_s);
                self.drive.receive_byte(t_s, byte, self.drive_counts());
                self.collect_reports();
            }
            _ => {}
        }
    }

    fn can_tx(&mut self, t_s: f64, frame: &CanFrame) -> CanOutcome {
        self.advance(t_s);
        if self.can_shorted {
            return CanOutcome::BitError;
        }
        if self.silent || !self.drive.acknowledges(t_s) {
            return CanOutcome::Unacknowledged;
        }
        let length = usize::from(frame.dlc).min(frame.data.len());
        let received =
            Received { id: frame.id, extended: frame.extended, remote: frame.remote, data: &frame.data[..length] };
        self.drive.receive(t_s, &received, self.drive_counts());
        self.collect_reports();
        CanOutcome::Acknowledged
    }

    fn gpio_out(&mut self, t_s: f64, port: char, levels: u16) {
        self.advance(t_s);
        if port == RELAY.0 {
            self.set_relay(levels >> RELAY.1 & 1 == 1);
        }
    }

    fn quadrature(&mut self, t_s: f64, timer: u8) -> i64 {
        self.advance(t_s);
        if timer != 3 {
            return 0;
        }
        let ahead_s = (t_s - self.now_s()).clamp(0.0, STEP_S);
        let angle_rad = self.motor.angle_rad + self.motor.speed_rad_per_s * ahead_s;
        self.encoder.counts_at_mcu(angle_rad) - self.boot_counts
    }

    fn next_event_s(&self) -> f64 {
        if !self.polled {
            return 0.0;
        }
        let tick = (self.steps / STEPS_PER_TICK + 1) * STEPS_PER_TICK;
        let tick_s = tick as f64 * STEP_S;
        self.from_drive.front().map_or(tick_s, |(at_s, _)| at_s.min(tick_s))
    }

    fn poll(&mut self, t_s: f64) -> Vec<Stimulus> {
        self.polled = true;
        self.advance(t_s);
        let mut stimuli = std::mem::take(&mut self.pending);
        while let Some((_, sent)) = self.from_drive.pop_front_if(|(at_s, _)| *at_s <= t_s + SAME_TIME_S) {
            stimuli.push(sent);
        }
        stimuli
    }
}
