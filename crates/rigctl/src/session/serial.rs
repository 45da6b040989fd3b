//! A serial device: the ST-LINK's virtual COM port.

use super::port::{Port, Received};
use crate::failure::Failure;
use anyhow::Context;
use serialport::SerialPort;
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

/// A real port.
pub struct Serial {
    port: Box<dyn SerialPort>,
    opened: Instant,
}

impl Serial {
    /// Opens a device.
    ///
    /// # Errors
    /// If it cannot be opened; names it.
    pub fn open(device: &str) -> Result<Self, Failure> {
        let port = serialport::new(device, rig_link::BAUD)
            .timeout(Duration::from_millis(2))
            .open()
            .map_err(|e| Failure::failed(format!("--port {device}: {}", why(&e))))?;
        Ok(Self { port, opened: Instant::now() })
    }
}

/// Why a device cannot be opened, in words.
fn why(error: &serialport::Error) -> String {
    match error.to_string() {
        text if text.contains("exclusive lock") => {
            "another program has opened it; if that is rigctl, Ctrl-C there stops the rig".into()
        }
        text if text.contains("typewriter") || text.contains("ioctl") => "is not a serial device".into(),
        text => format!("{text} (--port is `sim`, `auto` or a serial device)"),
    }
}

impl Port for Serial {
    fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Received, Failure> {
        let end = Instant::now() + Duration::from_secs_f64(seconds);
        self.port.write_all(bytes).context("writing to the serial port")?;
        let mut received = Received::default();
        let mut buffer = [0; 256];
        while Instant::now() < end {
            match self.port.read(&mut buffer) {
                Ok(count) => received.bytes.extend_from_slice(&buffer[..count]),
                Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(e) => return Err(anyhow::Error::new(e).context("reading from the serial port").into()),
            }
        }
        Ok(received)
    }

    fn now_s(&self) -> f64 {
        self.opened.elapsed().as_secs_f64()
    }
}
