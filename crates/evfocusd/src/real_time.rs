//! Real time: asking the operating system for it, and keeping in mind what was granted.
//!
//! Nothing of it is needed to run, so what is refused is a line in the log and in the status, and no error.

use std::sync::{Arc, Mutex, PoisonError};

use evfocus_ipc::Grant;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

use crate::config::RealTimeSection;

/// What was asked for so far, and what came of it. Clones share the same list.
#[derive(Debug, Clone, Default)]
pub(crate) struct Grants(Arc<Mutex<Vec<Grant>>>);

/// What a thread asks for once it runs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Wish {
    name: &'static str,
    /// Under `SCHED_FIFO`.
    priority: Option<u8>,
    cpus: Option<Vec<u16>>,
    grants: Grants,
}

impl Grants {
    /// What was asked for so far.
    pub(crate) fn list(&self) -> Vec<Grant> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What the control thread and the camera's are to ask for. Memory is locked at once, if that is asked for.
    pub(crate) fn wishes(&self, asked: &RealTimeSection) -> [Wish; 2] {
        if asked.lock_memory {
            self.lock_memory();
        }
        let wish = |name, priority, cpus: &Option<Vec<u16>>| Wish {
            name,
            priority,
            cpus: cpus.clone(),
            grants: self.clone(),
        };
        [
            wish("control", asked.control_priority, &asked.control_cpus),
            wish("camera", asked.camera_priority, &asked.camera_cpus),
        ]
    }

    /// Locks memory as it is touched: the buffers are large, and most of their pages are never used.
    fn lock_memory(&self) {
        let locked = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT);
        self.note("memory", "locked", locked, "LimitMEMLOCK=infinity in the unit, or ulimit -l unlimited");
    }

    fn note<Failure: std::fmt::Display>(
        &self,
        what: &str,
        asked: &str,
        outcome: Result<(), Failure>,
        remedy: &str,
    ) {
        let remedy = outcome.err().map(|error| format!("{error}: {remedy}"));
        match &remedy {
            None => tracing::info!(what, asked, "granted"),
            Some(remedy) => tracing::warn!(what, asked, %remedy, "not granted"),
        }
        let grant =
            Grant { what: what.to_owned(), asked: asked.to_owned(), granted: remedy.is_none(), remedy };
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(grant);
    }
}

impl Wish {
    /// Asks for it on behalf of the calling thread.
    pub(crate) fn ask(&self) {
        let Self { name, priority, cpus, grants } = self;
        if let Some(priority) = *priority {
            grants.note(
                &format!("{name} scheduling"),
                &format!("SCHED_FIFO {priority}"),
                fifo(priority),
                &format!("LimitRTPRIO={priority} in the unit, or ulimit -r {priority}"),
            );
        }
        if let Some(cpus) = cpus {
            let mut set = CpuSet::new();
            for &cpu in cpus {
                set.set(usize::from(cpu));
            }
            let names: Vec<String> = cpus.iter().map(u16::to_string).collect();
            grants.note(
                &format!("{name} processors"),
                &names.join(" "),
                sched_setaffinity(None, &set),
                "name processors that this machine has and the unit allows (CPUAffinity=, AllowedCPUs=)",
            );
        }
    }
}

fn fifo(priority: u8) -> Result<(), String> {
    let value = ThreadPriorityValue::try_from(priority).map_err(|refused| format!("{refused:?}"))?;
    set_thread_priority_and_policy(
        thread_native_id(),
        ThreadPriority::Crossplatform(value),
        ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo),
    )
    .map_err(|error| match error {
        thread_priority::Error::OS(number) => std::io::Error::from_raw_os_error(number).to_string(),
        other @ (thread_priority::Error::Priority(_)
        | thread_priority::Error::PriorityNotInRange(_)
        | thread_priority::Error::Ffi(_)) => format!("{other:?}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_processor_that_is_not_there_is_refused_and_said_with_its_remedy() {
        let grants = Grants::default();
        let section = RealTimeSection { camera_cpus: Some(vec![1000]), ..RealTimeSection::default() };
        for wish in grants.wishes(&section) {
            wish.ask();
        }
        let [grant] = grants.list().try_into().unwrap();
        assert!(!grant.granted && grant.asked == "1000" && grant.what == "camera processors", "{grant:?}");
        assert!(grant.remedy.unwrap().contains("AllowedCPUs="));
    }

    #[test]
    fn nothing_asked_nothing_noted() {
        let grants = Grants::default();
        for wish in grants.wishes(&RealTimeSection::default()) {
            wish.ask();
        }
        assert!(grants.list().is_empty());
    }
}
