//! `serve`: the rig for several programs at once, on a local socket.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;

/// Runs the command until it is interrupted; `fast` lets emulated time pass as fast as it can.
///
/// # Errors
/// If the address is no free path, nobody answers, or the port fails.
#[cfg(unix)]
pub fn run(global: &Global, listen: &str, fast: bool, output: &mut Output) -> Result<(), Failure> {
    use crate::serve::{PROTOCOL, Socket, serve};
    use serde_json::json;

    let socket = Socket::bind(listen)?;
    let scene = global.scene()?;
    let target = global.target()?;
    if fast && !target.is_emulated() {
        return Err(Failure::Usage(format!("--fast is for the emulated board, not for --port {}", target.port())));
    }
    let mut session = target.connect()?;
    // A board that has restarted moves nothing until it is greeted anew.
    session.greet_at_boot();
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
    serve(&mut session, &socket, &hello, target.is_emulated() && !fast)
}

/// Without Unix sockets there is nothing that knows who connects.
///
/// # Errors
/// Always.
#[cfg(not(unix))]
pub fn run(_: &Global, _: &str, _: bool, _: &mut Output) -> Result<(), Failure> {
    Err(Failure::failed("serve needs Unix sockets, which know who connects; this system has none"))
}
