//! A serial device: the ST-LINK's virtual COM port, named or found.

use super::link::Port;
use crate::failure::Failure;
use anyhow::Context;
use rig_plant::Run;
use serialport::{SerialPort, SerialPortInfo, SerialPortType};
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

/// USB vendor of STMicroelectronics, and products that are ST-LINKs with a virtual serial port (V2-1 and V3; the udev rules
/// of public ST-LINK tools list the same).
const VENDOR: u16 = 0x0483;
const PRODUCTS: std::ops::RangeInclusive<u16> = 0x374a..=0x3757;

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
    fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Run, Failure> {
        let end = Instant::now() + Duration::from_secs_f64(seconds);
        self.port.write_all(bytes).context("writing to the serial port")?;
        let mut received = Run::default();
        let mut buffer = [0; 256];
        while Instant::now() < end {
            match self.port.read(&mut buffer) {
                Ok(count) => received.uart.extend_from_slice(&buffer[..count]),
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

/// The device of the one ST-LINK that is there.
///
/// # Errors
/// If there is none or several: what there is.
pub fn auto() -> Result<String, Failure> {
    let ports = serialport::available_ports()
        .map_err(|e| Failure::failed(format!("--port auto: the serial ports cannot be listed: {e}")))?;
    st_link(&ports).map_err(Failure::failed)
}

fn st_link(ports: &[SerialPortInfo]) -> Result<String, String> {
    let is_st_link = |port: &&SerialPortInfo| match &port.port_type {
        SerialPortType::UsbPort(usb) => usb.vid == VENDOR && PRODUCTS.contains(&usb.pid),
        _ => false,
    };
    // macOS shows each port twice, as `cu` and as `tty`, and only the first opens without a carrier.
    let twice = |port: &&SerialPortInfo| !port.port_name.starts_with("/dev/tty.");
    let found: Vec<&str> = ports.iter().filter(is_st_link).filter(twice).map(|port| port.port_name.as_str()).collect();
    let all: Vec<&str> = ports.iter().map(|port| port.port_name.as_str()).collect();
    match (&found[..], &all[..]) {
        ([one], _) => Ok((*one).to_owned()),
        ([], []) => {
            Err("--port auto: there is no serial port: is the board's USB cable plugged in at the ST-LINK?".into())
        }
        ([], _) => Err(format!("--port auto: none of the serial ports is an ST-LINK's: {}", all.join(", "))),
        _ => Err(format!("--port auto: there are several ST-LINKs: name one of {}", found.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::UsbPortInfo;

    fn port(name: &str, usb: Option<(u16, u16)>) -> SerialPortInfo {
        let usb = usb.map(|(vid, pid)| {
            let (serial_number, manufacturer, product) = (None, None, None);
            SerialPortType::UsbPort(UsbPortInfo { vid, pid, serial_number, manufacturer, product })
        });
        SerialPortInfo { port_name: name.into(), port_type: usb.unwrap_or(SerialPortType::Unknown) }
    }

    #[test]
    fn the_one_st_link_is_taken_and_nothing_else() {
        let (first, second) =
            (port("/dev/ttyACM0", Some((0x0483, 0x374b))), port("/dev/ttyACM1", Some((0x0483, 0x374e))));
        let (line, modem) = (port("/dev/ttyS0", None), port("/dev/ttyACM2", Some((0x0483, 0x5740))));
        assert_eq!(st_link(&[line.clone(), first.clone(), modem.clone()]), Ok("/dev/ttyACM0".into()));
        let twice = port("/dev/tty.usbmodem1", Some((0x0483, 0x374b)));
        assert_eq!(st_link(&[twice, first.clone()]), Ok("/dev/ttyACM0".into()));
        assert!(st_link(&[]).unwrap_err().contains("no serial port"));
        let none = st_link(&[line, modem]).unwrap_err();
        assert!(none.contains("/dev/ttyS0, /dev/ttyACM2"), "{none}");
        let several = st_link(&[first, second]).unwrap_err();
        assert!(several.contains("name one of /dev/ttyACM0, /dev/ttyACM1"), "{several}");
    }
}
