//! The socket file: its owner alone may open it, and whoever connects is asked who he is. A file that a dead server left is
//! replaced; a live server keeps its own.

use crate::failure::Failure;
use nix::sys::stat::{Mode, umask};
use nix::unistd::{Uid, geteuid};
use std::fs::{Metadata, symlink_metadata};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

/// A listening socket, whose file is removed at the end.
pub struct Socket {
    listener: UnixListener,
    path: PathBuf,
    /// Device and number of its file: at the end another server's file may have its name.
    file: (u64, u64),
}

/// Why an address cannot be listened on because it is one of a network; none for a path.
fn network_address(address: &str) -> Option<String> {
    let port = address.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let is_network = !address.contains('/') && port || address.contains("://");
    is_network.then(|| {
        format!(
            "--listen {address}: only the path of a Unix socket is possible. Over TCP nobody can check who connects, and \
             whoever reaches the port could move the rig (a file of this name: ./{address})"
        )
    })
}

impl Socket {
    /// Listens on a path. Only the owner may open the file (mode 0600).
    ///
    /// # Errors
    /// If it is no path, is taken by a live server or by another file, or cannot be made.
    pub fn bind(address: &str) -> Result<Self, Failure> {
        if let Some(message) = network_address(address) {
            return Err(Failure::Usage(message));
        }
        let path = PathBuf::from(address);
        let wrong = |what: &dyn std::fmt::Display| Failure::failed(format!("--listen {address}: {what}"));
        remove_stale(&path).map_err(|e| wrong(&e))?;
        // The file must never be open to others, not even for a moment. No other thread makes files now.
        let before = umask(Mode::from_bits_truncate(0o177));
        let bound = UnixListener::bind(&path);
        umask(before);
        let listener = bound.map_err(|e| wrong(&e))?;
        let file = symlink_metadata(&path).map(identity).map_err(|e| wrong(&e))?;
        Ok(Self { listener, path, file })
    }

    /// Another handle for the thread that accepts.
    ///
    /// # Errors
    /// If the process has no handle left.
    pub fn listener(&self) -> io::Result<UnixListener> {
        self.listener.try_clone()
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        if symlink_metadata(&self.path).is_ok_and(|found| identity(found) == self.file) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

fn identity(file: Metadata) -> (u64, u64) {
    (file.dev(), file.ino())
}

fn remove_stale(path: &Path) -> io::Result<()> {
    match symlink_metadata(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(e),
        Ok(found) if !found.file_type().is_socket() => {
            return Err(io::Error::new(ErrorKind::AlreadyExists, "is there, and is not a socket"));
        }
        Ok(_) => {}
    }
    match UnixStream::connect(path) {
        Ok(_) => Err(io::Error::new(ErrorKind::AddrInUse, "another server listens there; end it first")),
        // Nobody listens any more.
        Err(e) if e.kind() == ErrorKind::ConnectionRefused => std::fs::remove_file(path),
        Err(e) => Err(e),
    }
}

/// Checks that the process at the other end is the server's own user's, or root's.
///
/// # Errors
/// In words, naming both users.
pub fn check_peer(stream: &UnixStream) -> Result<(), String> {
    let peer = peer(stream).map_err(|e| format!("the operating system does not say who connects: {e}"))?;
    check_user(peer, geteuid())
}

#[cfg(any(target_os = "linux", target_os = "android"))]
fn peer(stream: &UnixStream) -> nix::Result<Uid> {
    use nix::sys::socket::{getsockopt, sockopt::PeerCredentials};
    getsockopt(stream, PeerCredentials).map(|peer| Uid::from_raw(peer.uid()))
}

#[cfg(not(any(target_os = "linux", target_os = "android")))]
fn peer(stream: &UnixStream) -> nix::Result<Uid> {
    nix::unistd::getpeereid(stream).map(|(user, _)| user)
}

fn check_user(peer: Uid, own: Uid) -> Result<(), String> {
    if peer == own || peer.is_root() {
        return Ok(());
    }
    Err(format!("this rig is served for user {own} alone, not for user {peer}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// A path of its own for each test.
    fn path(name: &str) -> String {
        std::env::temp_dir().join(format!("rigctl-{name}-{}", std::process::id())).display().to_string()
    }

    fn refusal(address: &str) -> String {
        Socket::bind(address).err().and_then(|failure| failure.message()).expect("refused")
    }

    #[test]
    fn the_owner_alone_may_open_it_and_it_is_removed_at_the_end() {
        let path = path("mode");
        let socket = Socket::bind(&path).expect("bound");
        assert_eq!(symlink_metadata(&path).expect("there").permissions().mode() & 0o777, 0o600);
        assert!(refusal(&path).contains("another server listens there"));
        // Another server's file of the same name stays.
        std::fs::remove_file(&path).expect("there");
        std::fs::write(&path, "of somebody else").expect("written");
        drop(socket);
        assert!(refusal(&path).contains("is not a socket"));
        std::fs::remove_file(&path).expect("still there");
        drop(Socket::bind(&path).expect("bound"));
        assert!(symlink_metadata(&path).is_err());
    }

    #[test]
    fn a_dead_servers_file_is_replaced() {
        let path = path("stale");
        drop(UnixListener::bind(&path).expect("bound"));
        assert!(symlink_metadata(&path).is_ok(), "a listener leaves its file");
        drop(Socket::bind(&path).expect("replaced"));
    }

    #[test]
    fn an_address_of_a_network_is_refused_with_the_reason() {
        for address in ["127.0.0.1:5000", "localhost:5000", ":5000", "[::1]:5000", "tcp://127.0.0.1:5000"] {
            assert!(matches!(Socket::bind(address), Err(Failure::Usage(m)) if m.contains("who connects")), "{address}");
        }
        for path in ["rig.sock", "./127.0.0.1:5000", "/run/user/1000/rig:1", "rig:one"] {
            assert_eq!(network_address(path), None, "{path}");
        }
        assert!(refusal("/no/such/folder/rig").contains("--listen /no/such/folder/rig"));
        assert!(refusal(&format!("/tmp/{}", "x".repeat(200))).contains("--listen"));
    }

    #[test]
    fn only_the_owner_and_root_are_served() {
        let [root, one, two] = [0, 1000, 1001].map(Uid::from_raw);
        assert!(check_user(one, one).is_ok() && check_user(root, one).is_ok() && check_user(root, root).is_ok());
        assert!(check_user(two, one).is_err() && check_user(one, root).is_err_and(|why| why.contains("1000")));
        let (stream, _other) = UnixStream::pair().expect("a pair");
        assert_eq!(check_peer(&stream), Ok(()), "the test itself");
    }
}
