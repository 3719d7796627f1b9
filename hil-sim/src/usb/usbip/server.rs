//! Cameras over TCP, in real time.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::super::UsbPort;
use super::import::{self, Offer};
use super::{Session, UsbIpError};

/// How often the rig is looked at while the host is silent: data is at most this late.
const PERIOD_NANOS: i64 = 500_000;
/// How long a host may take to say what it wants.
const PATIENCE: Duration = Duration::from_secs(5);

/// Offers a port's camera from a thread of its own until it is dropped; one host at a time.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Listens on TCP port `number` of the loopback interface, any if it is zero. The port of USB/IP is 3240.
    ///
    /// # Errors
    /// The operating system's, if the port is taken.
    pub fn tcp(port: UsbPort, number: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, number))?;
        let address = listener.local_addr()?;
        let stop = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&stop);
        let thread = std::thread::Builder::new().name("hil-sim-usbip".to_owned()).spawn(move || {
            while !told.load(Ordering::SeqCst) {
                if is_readable(&listener, false)
                    && let Ok((stream, _)) = listener.accept()
                {
                    // Whatever ended it, the host has noticed; the next one is welcome.
                    host(&port, stream, &told).unwrap_or_default();
                }
            }
        })?;
        Ok(Self { address, stop, thread: Some(thread) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What hosts call the camera: `usbip attach --remote ADDRESS --busid 1-1`.
    pub fn bus_id(&self) -> &'static str {
        import::BUS_ID
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

/// Waits for the host for one period, or not at all.
fn is_readable(file: &impl AsFd, at_once: bool) -> bool {
    let mut poll_for = [PollFd::new(file, PollFlags::IN)];
    let wait = Timespec { tv_sec: 0, tv_nsec: if at_once { 0 } else { PERIOD_NANOS } };
    matches!(poll(&mut poll_for, Some(&wait)), Ok(ready) if ready > 0)
}

/// One host, from its question to its end.
fn host(port: &UsbPort, mut stream: TcpStream, stop: &AtomicBool) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    let session = port.attach().ok();
    let offer = session
        .as_ref()
        .map(|session| Offer { identity: session.identity().clone(), description: session.description() });
    match session {
        Some(session) if import::answer(&mut stream, offer.as_ref())? => carry(session, &mut stream, stop),
        Some(_) => Ok(()),
        None => import::answer(&mut stream, None).map(drop),
    }
}

/// Carries bytes both ways until the host hangs up, the camera's cable is pulled, or the server is stopped.
///
/// # Errors
/// The stream's, or as invalid data what the host did wrong.
fn carry<S>(mut session: Session, stream: &mut S, stop: &AtomicBool) -> io::Result<()>
where
    S: io::Read + io::Write + AsFd,
{
    let (mut buffer, mut answers, mut is_busy) = (vec![0; 65_536], Vec::new(), false);
    while !stop.load(Ordering::SeqCst) {
        let mut ended = Ok(());
        if is_readable(stream, is_busy) {
            let length = stream.read(&mut buffer)?;
            if length == 0 {
                return Ok(());
            }
            ended = session.receive(buffer.get(..length).unwrap_or_default(), &mut answers);
        }
        if ended.is_ok() {
            ended = session.advance(&mut answers).map(|busy| is_busy = busy);
        }
        stream.write_all(&answers)?;
        answers.clear();
        match ended {
            Ok(()) => {}
            Err(UsbIpError::Unplugged) => return Ok(()),
            Err(error) => return Err(io::Error::new(io::ErrorKind::InvalidData, error)),
        }
    }
    Ok(())
}
