//! A USB/IP host of the tests' own: it writes commands and reads answers by the protocol's paper.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::Geometry;
use evfocus_hal::{Clock, VirtualClock};
use hil_sim::usbip::{Session, UsbIpError};
use hil_sim::{
    CameraModel, LensConfig, Light, MotionConfig, Rig, RigConfig, SensorConfig, UsbModel, UsbPort,
};

/// An answer to a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Answer {
    /// 3: a transfer has ended; 4: one has been given back or not.
    pub(crate) kind: u32,
    pub(crate) sequence: u32,
    pub(crate) status: i32,
    pub(crate) length: u32,
    pub(crate) data: Vec<u8>,
}

/// A transfer's command. `endpoint` has the direction in bit 7.
pub(crate) fn submit(sequence: u32, endpoint: u8, length: u32, setup: [u8; 8], data: &[u8]) -> Vec<u8> {
    let words =
        [1, sequence, 0x1_0001, u32::from(endpoint >> 7), u32::from(endpoint & 0xF), 0, length, 0, 0, 0];
    let mut command: Vec<u8> = words.into_iter().flat_map(u32::to_be_bytes).collect();
    command.extend(setup);
    command.extend(data);
    command
}

pub(crate) fn unlink(sequence: u32, victim: u32) -> Vec<u8> {
    let words = [2, sequence, 0x1_0001, 0, 0, victim, 0, 0, 0, 0, 0, 0];
    words.into_iter().flat_map(u32::to_be_bytes).collect()
}

pub(crate) fn setup(kind: u8, request: u8, value: u16, index: u16, length: u16) -> [u8; 8] {
    let [[v0, v1], [i0, i1], [l0, l1]] = [value, index, length].map(u16::to_le_bytes);
    [kind, request, v0, v1, i0, i1, l0, l1]
}

/// A host, the session it talks to, and the rig behind.
pub(crate) struct Host {
    pub(crate) port: UsbPort,
    pub(crate) clock: Arc<VirtualClock>,
    pub(crate) session: Session,
    sequence: u32,
    /// Sequence numbers of transfers to the host that have not ended: their answers have data.
    asked: Vec<u32>,
}

impl Host {
    pub(crate) fn new(model: UsbModel) -> Self {
        Self::before(model, MotionConfig::moving(200.0))
    }

    /// A host of a camera that sees a scene move.
    pub(crate) fn before(model: UsbModel, motion: MotionConfig) -> Self {
        let kind = match model {
            UsbModel::Davis346 => CameraModel::Davis346,
            UsbModel::Evk4 => CameraModel::Imx636,
        };
        let geometry = Geometry { width: 64, height: 48 };
        let config = RigConfig {
            sensor: SensorConfig { geometry, ..SensorConfig::preset(kind, Light::Light) },
            motion,
            // In focus: blurred, nothing would be seen to move.
            lens: LensConfig { start: RigConfig::default().focus, ..LensConfig::default() },
            ..RigConfig::default()
        };
        let clock = Arc::new(VirtualClock::new());
        let port = Rig::new(config, clock.clone()).unwrap().plug(model);
        let session = port.attach().unwrap();
        Self { port, clock, session, sequence: 0, asked: Vec::new() }
    }

    /// Sends bytes, lets the device work at the present time, and reads what it answers.
    pub(crate) fn exchange(&mut self, bytes: &[u8]) -> Result<Vec<Answer>, UsbIpError> {
        let mut answers = Vec::new();
        self.session.receive(bytes, &mut answers)?;
        while self.session.advance(&mut answers)? {}
        Ok(self.read(&answers))
    }

    /// Time passes in steps of a millisecond.
    pub(crate) fn pass(&mut self, milliseconds: u64) -> Result<Vec<Answer>, UsbIpError> {
        let mut answers = Vec::new();
        for _ in 0..milliseconds {
            self.clock.sleep_until(self.clock.now() + Duration::from_millis(1));
            answers.extend(self.exchange(&[])?);
        }
        Ok(answers)
    }

    fn read(&mut self, mut bytes: &[u8]) -> Vec<Answer> {
        let mut answers = Vec::new();
        while !bytes.is_empty() {
            let (header, rest) = bytes.split_at(48);
            let word = |index: usize| u32::from_be_bytes(*header[index * 4..].first_chunk().unwrap());
            let (kind, sequence, length) = (word(0), word(1), word(6));
            let has_data = kind == 3 && self.asked.contains(&sequence);
            self.asked.retain(|asked| *asked != sequence);
            let (data, rest) = rest.split_at(if has_data { length as usize } else { 0 });
            answers.push(Answer { kind, sequence, status: word(5) as i32, length, data: data.to_vec() });
            bytes = rest;
        }
        answers
    }

    /// Submits a transfer to the host; its number.
    pub(crate) fn ask(&mut self, endpoint: u8, length: u32) -> Result<(u32, Vec<Answer>), UsbIpError> {
        self.sequence += 1;
        self.asked.push(self.sequence);
        let command = submit(self.sequence, endpoint, length, [0; 8], &[]);
        Ok((self.sequence, self.exchange(&command)?))
    }

    /// Gives a transfer back; status of the answer.
    pub(crate) fn give_back(&mut self, victim: u32) -> Result<i32, UsbIpError> {
        self.sequence += 1;
        let answers = self.exchange(&unlink(self.sequence, victim))?;
        assert_eq!((answers[0].kind, answers[0].sequence), (4, self.sequence));
        Ok(answers[0].status)
    }

    /// A request on endpoint 0; its answer, or the status that refused it.
    pub(crate) fn control(&mut self, setup: [u8; 8], data: &[u8]) -> Result<Vec<u8>, i32> {
        self.sequence += 1;
        let is_in = setup[0] & 0x80 != 0;
        let length = u16::from_le_bytes([setup[6], setup[7]]);
        if is_in {
            self.asked.push(self.sequence);
        }
        let endpoint = if is_in { 0x80 } else { 0 };
        let command = submit(self.sequence, endpoint, u32::from(length), setup, data);
        let answers = self.exchange(&command).unwrap();
        let answer = answers.into_iter().find(|answer| answer.sequence == self.sequence).unwrap();
        if answer.status == 0 { Ok(answer.data) } else { Err(answer.status) }
    }

    /// Sends on a bulk endpoint; the answers that came at once.
    pub(crate) fn send(&mut self, endpoint: u8, data: &[u8]) -> Result<Vec<Answer>, UsbIpError> {
        self.sequence += 1;
        self.exchange(&submit(self.sequence, endpoint, data.len() as u32, [0; 8], data))
    }

    /// Writes a register of a DAVIS346.
    pub(crate) fn write(&mut self, module: u16, parameter: u16, value: u32) {
        self.control(setup(0x40, 0xBF, module, parameter, 4), &value.to_be_bytes()).unwrap();
    }

    /// Starts a DAVIS346 with its whole picture.
    pub(crate) fn start(&mut self) {
        let registers =
            [(1, 43, 345), (1, 44, 259), (9, 1, 8064), (0, 3, 1), (9, 0, 1), (0, 1, 1), (0, 0, 1), (1, 3, 1)];
        for (module, parameter, value) in registers {
            self.write(module, parameter, value);
        }
    }
}
