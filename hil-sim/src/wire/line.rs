//! A controller and its line: when bytes arrive, and what becomes of them on the way.

use std::collections::VecDeque;
use std::time::Duration;

use evfocus_core::HostMicros;

use super::fault::WireFault;
use super::{Device, Motor, Protocol};

/// What a host that does not read leaves behind, bytes; more is lost, as in a tty.
const BACKLOG: usize = 65_536;

/// A model on its line.
#[derive(Debug)]
pub(super) struct Line {
    device: Box<dyn Device>,
    motor: Motor,
    bytes_per_second: Option<f64>,
    latency: Duration,
    /// Bytes that are on their way to the host or wait there, with their arrival.
    outgoing: VecDeque<(HostMicros, u8)>,
    /// When the line is free again.
    free: HostMicros,
    fault: Option<WireFault>,
    /// Counts the times the cable was pulled: a connection of an earlier plug is dead.
    plugged: u32,
}

impl Line {
    pub(super) fn new(protocol: Protocol, motor: Motor) -> Self {
        Self {
            device: protocol.device(motor.clone()),
            motor,
            bytes_per_second: protocol.bytes_per_second(),
            latency: protocol.latency(),
            outgoing: VecDeque::new(),
            free: HostMicros(0),
            fault: None,
            plugged: 0,
        }
    }

    /// The plug that a connection opened at `now` belongs to; nothing if the cable is out.
    pub(super) fn plug(&self, now: HostMicros) -> Option<u32> {
        let is_out = self.fault == Some(WireFault::Unplugged) || self.motor.is_unplugged(now);
        (!is_out).then_some(self.plugged)
    }

    pub(super) fn strike(&mut self, fault: WireFault, now: HostMicros) {
        self.catch_up(now);
        match fault {
            WireFault::Reset => {
                self.outgoing.clear();
                self.device.reset(now);
            }
            WireFault::PositionJump(counts) => self.device.miscount(counts),
            WireFault::Unplugged => {
                self.outgoing.clear();
                self.plugged += 1;
                self.fault = Some(fault);
            }
            WireFault::Silence
            | WireFault::Garbage
            | WireFault::HalfReplies
            | WireFault::WrongBit
            | WireFault::SlowReplies(_) => self.fault = Some(fault),
        }
    }

    pub(super) fn repair(&mut self) {
        self.fault = None;
    }

    /// How long `length` bytes are on the line.
    pub(super) fn transfer(&self, length: usize) -> Duration {
        self.bytes_per_second.map_or(Duration::ZERO, |rate| Duration::from_secs_f64(length as f64 / rate))
    }

    /// The controller hears `bytes`, the last of which arrives at `now`.
    pub(super) fn receive(&mut self, bytes: &[u8], now: HostMicros) {
        self.catch_up(now);
        let mut replies = Vec::new();
        self.device.receive(bytes, now, &mut replies);
        self.reply(replies, now);
    }

    /// Moves what has arrived at the host by `now` into `buffer`.
    pub(super) fn take(&mut self, buffer: &mut [u8], now: HostMicros) -> usize {
        self.catch_up(now);
        let arrived = self.outgoing.partition_point(|&(arrival, _)| arrival <= now).min(buffer.len());
        for (place, (_, byte)) in buffer.iter_mut().zip(self.outgoing.drain(..arrived)) {
            *place = byte;
        }
        arrived
    }

    /// When to look again: the next byte arrives, or the controller speaks.
    pub(super) fn next(&self) -> Option<HostMicros> {
        let arrival = self.outgoing.front().map(|&(arrival, _)| arrival);
        [arrival, self.device.due()].into_iter().flatten().min()
    }

    /// Lets the controller say what it has said by `now`.
    fn catch_up(&mut self, now: HostMicros) {
        while let Some(due) = self.device.due().filter(|&due| due <= now) {
            let mut said = Vec::new();
            self.device.speak(due, &mut said);
            self.reply(said, due);
        }
    }

    /// Sends `reply` on its way at `now`.
    fn reply(&mut self, mut reply: Vec<u8>, now: HostMicros) {
        let mut start = (now + self.latency).max(self.free);
        if let Some(fault) = self.fault {
            fault.spoil(&mut reply);
            if let WireFault::SlowReplies(delay) = fault {
                start += delay;
            }
        }
        if self.plug(now).is_none() || self.motor.is_silent(now) {
            return;
        }
        let room = BACKLOG.saturating_sub(self.outgoing.len());
        for (index, &byte) in reply.iter().take(room).enumerate() {
            self.outgoing.push_back((start + self.transfer(index + 1), byte));
        }
        self.free = start + self.transfer(reply.len());
    }
}
