//! The real board, on its debug probe's serial port.

use super::{Transport, TransportError};
use serialport::{DataBits, FlowControl, Parity, SerialPort, StopBits};
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

/// A serial port, 115200 8N1.
pub struct Serial {
    name: String,
    port: Box<dyn SerialPort>,
    opened: Instant,
}

impl Serial {
    /// Opens the port.
    ///
    /// # Errors
    /// [`TransportError::Open`] naming it.
    pub fn open(name: &str) -> Result<Self, TransportError> {
        let port = serialport::new(name, rig_link::BAUD)
            .data_bits(DataBits::Eight)
            .parity(Parity::None)
            .stop_bits(StopBits::One)
            .flow_control(FlowControl::None)
            .timeout(Duration::from_millis(1))
            .open()
            .map_err(|source| TransportError::Open { port: name.into(), source })?;
        Ok(Self { name: name.into(), port, opened: Instant::now() })
    }

    fn failed(&self, source: std::io::Error) -> TransportError {
        TransportError::Port { port: self.name.clone(), source }
    }
}

impl Transport for Serial {
    fn now_s(&self) -> f64 {
        self.opened.elapsed().as_secs_f64()
    }

    fn pass(&mut self, until_s: f64, bytes: &[u8], received: &mut Vec<u8>) -> Result<(), TransportError> {
        self.port.write_all(bytes).map_err(|e| self.failed(e))?;
        let mut buffer = [0; 512];
        loop {
            match self.port.read(&mut buffer) {
                Ok(0) => return Err(self.failed(ErrorKind::UnexpectedEof.into())),
                Ok(count) => received.extend_from_slice(&buffer[..count]),
                Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(e) => return Err(self.failed(e)),
            }
            if self.now_s() >= until_s {
                return Ok(());
            }
        }
    }
}
