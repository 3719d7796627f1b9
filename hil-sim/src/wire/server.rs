//! A controller's port for other programs: a pseudo-terminal or a TCP port on the loopback interface, in real time.

use std::io;
use std::net::{Ipv4Addr, TcpListener};
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::WirePort;

/// How often the line is looked at, besides when the host sends: answers are at most this late.
const PERIOD_NANOS: i64 = 200_000;

/// Serves a port from a thread of its own until it is dropped.
#[derive(Debug)]
pub struct Server {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Puts `port` on a new pseudo-terminal.
    ///
    /// # Errors
    /// The operating system's, if it has no pseudo-terminal left.
    pub fn pty(port: WirePort) -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let path = ptsname(&master, Vec::new())?.into_string().map_err(io::Error::other)?;
        // Held open: when the last client of a pseudo-terminal leaves, its other end breaks.
        let kept = open_raw(&path)?;
        Self::start(path, move |stop| {
            let _kept = kept;
            carry_on(&port, &master, stop);
        })
    }

    /// Puts `port` on the serial port `path`, whose other end another program or machine has.
    ///
    /// # Errors
    /// The operating system's, if there is no such serial port or it may not be opened.
    pub fn serial(port: WirePort, path: &str) -> io::Result<Self> {
        let file = open_raw(path)?;
        Self::start(path.to_owned(), move |stop| carry_on(&port, &file, stop))
    }

    /// Puts `port` on a free TCP port of the loopback interface; one client at a time.
    ///
    /// # Errors
    /// The operating system's, if there is no port.
    pub fn tcp(port: WirePort) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?.to_string();
        Self::start(address, move |stop| {
            while !stop.load(Ordering::SeqCst) {
                if !is_readable(&listener) {
                    continue;
                }
                if let Ok((stream, _)) = listener.accept()
                    && stream.set_nodelay(true).is_ok()
                {
                    carry(&port, &OwnedFd::from(stream), stop);
                }
            }
        })
    }

    /// The path of the pseudo-terminal, or the address of the TCP port.
    pub fn address(&self) -> &str {
        &self.address
    }

    fn start(address: String, serve: impl FnOnce(&AtomicBool) + Send + 'static) -> io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&stop);
        let thread =
            std::thread::Builder::new().name("hil-sim-wire".to_owned()).spawn(move || serve(&told))?;
        Ok(Self { address, stop, thread: Some(thread) })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed.
            thread.join().unwrap_or_default();
        }
    }
}

/// Opens a terminal that passes every byte as it is: otherwise commands come back as answers.
fn open_raw(path: &str) -> io::Result<OwnedFd> {
    let file = std::fs::File::options().read(true).write(true).open(path)?;
    let mut attributes = tcgetattr(&file)?;
    attributes.make_raw();
    attributes.set_speed(115_200)?;
    tcsetattr(&file, OptionalActions::Now, &attributes)?;
    Ok(file.into())
}

/// Carries bytes whenever the cable is in, until the server is stopped.
fn carry_on(port: &WirePort, file: &OwnedFd, stop: &AtomicBool) {
    while !stop.load(Ordering::SeqCst) {
        carry(port, file, stop);
        // While the cable is out, what the host sends is lost.
        if is_readable(file) && port.line().plug(port.now()).is_none() {
            match rustix::io::read(file, &mut [0; 256]) {
                Ok(0) | Err(_) => return,
                Ok(_) => {}
            }
        }
    }
}

/// Waits for the host for one period.
fn is_readable(file: &impl AsFd) -> bool {
    let mut poll_for = [PollFd::new(file, PollFlags::IN)];
    let wait = Timespec { tv_sec: 0, tv_nsec: PERIOD_NANOS };
    matches!(poll(&mut poll_for, Some(&wait)), Ok(ready) if ready > 0)
}

/// Carries bytes both ways until the host hangs up, the cable is pulled, or the server is stopped.
fn carry(port: &WirePort, file: &OwnedFd, stop: &AtomicBool) {
    let mut buffer = [0; 4096];
    while !stop.load(Ordering::SeqCst) {
        if is_readable(file) {
            match rustix::io::read(file, &mut buffer) {
                Ok(0) | Err(_) => return,
                Ok(length) => port.line().receive(buffer.get(..length).unwrap_or_default(), port.now()),
            }
        }
        if port.line().plug(port.now()).is_none() {
            return;
        }
        let length = port.line().take(&mut buffer, port.now());
        let mut rest = buffer.get(..length).unwrap_or_default();
        while !rest.is_empty() && !stop.load(Ordering::SeqCst) {
            match rustix::io::write(file, rest) {
                Ok(written) => rest = rest.get(written..).unwrap_or_default(),
                Err(_) => return,
            }
        }
    }
}
