//! `serve`: the rig for several programs at once, on a local socket.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use clap::Args;

/// Share the actuator on a local socket: one controlling client, many readers
///
/// Every client gets the telemetry, one object a line as `play --json` prints it. The first one that sends an order, such as
/// {"id": 1, "do": "move", "to_m": 0.008}, is the writer until it disconnects or sends {"release": true}; a motion that
/// then goes on is stopped. Only the owner of the socket and root can connect. docs/how-to/integrate.md has the
/// protocol. On an emulated board time passes as on a real one. Ctrl-C stops the rig and ends.
/// Example: `rigctl serve --listen rig.sock`
#[derive(Debug, Args)]
pub struct Serve {
    /// Path of the socket. Network addresses are refused: over TCP nobody can check who connects
    #[arg(long, value_name = "ADDR")]
    listen: String,
    /// Let the time of an emulated board pass as fast as it can, for tests
    #[arg(long)]
    fast: bool,
}

impl Serve {
    /// Runs the command until it is interrupted.
    ///
    /// # Errors
    /// If the address is no free path, nobody answers, or the port fails.
    #[cfg(unix)]
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        use crate::serve::{PROTOCOL, Socket, serve};
        use crate::session::Wanted;
        use serde_json::json;

        let Self { listen, fast } = self;
        let socket = Socket::bind(listen)?;
        let scene = global.scene()?;
        let target = global.target()?;
        if *fast && !global.is_emulated() {
            return Err(Failure::Usage(format!("--fast is for the emulated board, not for --port {}", target.port())));
        }
        let mut session = target.connect(Wanted::OfScene)?;
        // A board that has restarted moves nothing until it is greeted again.
        session.greets = true;
        // Orders to a board that still starts would be refused.
        session.wait_started()?;
        let hello = json!({"hello": {
            "protocol": PROTOCOL,
            "tool": concat!("rigctl ", env!("CARGO_PKG_VERSION")),
            "firmware": session.require_identity()?.version.as_str(),
            "port": target.port(),
            "rig": target.rig(),
            "scene": target.scene.display().to_string(),
            "scene_hash": format!("{:08x}", scene.hash()),
            "gear_ratio": scene.rig.gear(),
        }});
        output.object(&json!({"listening": listen}))?;
        output.line(format!("listening on {listen}; Ctrl-C stops the rig and ends"))?;
        output.flush()?;
        serve(&mut session, &socket, &hello, global.is_emulated() && !fast)
    }

    /// Without Unix sockets there is nothing that knows who connects.
    ///
    /// # Errors
    /// Always.
    #[cfg(not(unix))]
    pub fn run(&self, _: &Global, _: &mut Output) -> Result<(), Failure> {
        Err(Failure::failed("serve needs Unix sockets, which know who connects; this system has none"))
    }
}
