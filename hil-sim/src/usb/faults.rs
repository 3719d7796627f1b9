//! What goes wrong on the wire, beyond the faults of the rig ([`FaultKind`](crate::FaultKind): unplugged, clock restarted, events
//! lost).

use std::time::Duration;

/// Faults of the device and its link. Each counts from the moment it is set.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct UsbFaults {
    /// The device says that it has this firmware: `bcdDevice` of a DAVIS346, the release of an EVK4.
    pub firmware: Option<u32>,
    /// A register reads as this value, whatever it holds: module, parameter and value of the DAVIS346; zero, address and value of the
    /// EVK4.
    pub told: Option<(u8, u32, u32)>,
    /// Requests take this long; more than the host waits is no answer.
    pub control_delay: Duration,
    /// Every answer is garbage.
    pub garbled_answers: bool,
    /// The data endpoint stalls this often, each time before its next transfer.
    pub stalls: u32,
    /// Transfers are cut into pieces of at most so many words.
    pub short_packets: Option<usize>,
    /// Of so many transfers, one is lost.
    pub lose_one_of: Option<u32>,
    /// Transfers end with half a word, whose other half is lost.
    pub odd_transfers: bool,
    /// The data endpoint sends so many transfers of arbitrary bytes before its next, and breaks the rules of USB after them.
    pub babble: Option<u32>,
    /// The system has no memory for so many transfers.
    pub no_memory_for: Option<usize>,
    /// For so long, nobody reads: the device drops what it would send, and says so when it goes on. Strikes once.
    pub overflow: Option<Duration>,
}
