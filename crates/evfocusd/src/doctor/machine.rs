//! What the kernel's files say of the machine.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::Finding;

/// Memory of the USB file system below which the cameras' transfers may not find room, MiB: 4 for the DAVIS346, with room to spare.
const USB_MEMORY_MIB: u64 = 16;
/// Room on the disk below which reports may soon not find any, MiB; one has 10 to 100 kB.
const DISK_MIB: u64 = 100;
/// Clock sources that are read without leaving the processor.
const GOOD_CLOCKS: [&str; 4] = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"];

/// The machine's files, below a folder that is `/` but in tests.
#[derive(Debug)]
pub(super) struct Machine {
    root: PathBuf,
}

impl Machine {
    pub(super) fn new(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    fn read(&self, path: &str) -> Option<String> {
        fs::read_to_string(self.root.join(path)).ok().map(|text| text.trim().to_owned())
    }

    /// Whether udev gives the cameras to the daemon.
    pub(super) fn udev_rule(&self, needs_usb: bool) -> Finding {
        const CHECK: &str = "udev rule";
        const PLACES: [&str; 3] = ["etc/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d"];
        let place = PLACES.iter().map(|place| format!("{place}/70-evfocus.rules"));
        match place.into_iter().find(|place| self.root.join(place).exists()) {
            Some(place) => Finding::good(CHECK, format!("/{place}")),
            None if needs_usb => Finding::trouble(
                CHECK,
                "not installed, so only root can open a camera",
                "copy config/udev/70-evfocus.rules to /etc/udev/rules.d, udevadm control --reload, plug the camera in again",
            ),
            None => Finding::good(CHECK, "not installed, and not needed without a camera on USB"),
        }
    }

    /// Whether the kernel lends enough memory to USB transfers.
    pub(super) fn usb_memory(&self, needs_usb: bool) -> Finding {
        const CHECK: &str = "usbfs memory";
        let text = self.read("sys/module/usbcore/parameters/usbfs_memory_mb");
        match text.as_deref().and_then(|text| text.parse().ok()) {
            Some(0) => Finding::good(CHECK, "unlimited"),
            Some(mib) if mib >= USB_MEMORY_MIB => Finding::good(CHECK, format!("{mib} MiB")),
            Some(mib) => Finding::trouble(
                CHECK,
                format!("{mib} MiB, too little for the transfers of a camera"),
                format!(
                    "echo {USB_MEMORY_MIB} > /sys/module/usbcore/parameters/usbfs_memory_mb; for good: usbcore.usbfs_memory_mb={USB_MEMORY_MIB} on the kernel's command line"
                ),
            ),
            None if needs_usb => Finding::trouble(
                CHECK,
                "the kernel has no USB",
                "modprobe usbcore, or a kernel with USB; in a container, pass /sys through",
            ),
            None => Finding::good(CHECK, "no USB, and none needed"),
        }
    }

    /// Whether the processors run at full speed when a sweep begins.
    pub(super) fn governor(&self) -> Finding {
        const CHECK: &str = "CPU governor";
        let folders = fs::read_dir(self.root.join("sys/devices/system/cpu")).into_iter().flatten().flatten();
        let governors: BTreeSet<String> = folders
            .filter_map(|folder| fs::read_to_string(folder.path().join("cpufreq/scaling_governor")).ok())
            .map(|text| text.trim().to_owned())
            .collect();
        let names = governors.iter().cloned().collect::<Vec<_>>().join(", ");
        if governors.is_empty() {
            Finding::good(CHECK, "the clock rate is not the kernel's business here")
        } else if governors.iter().all(|governor| governor == "performance") {
            Finding::good(CHECK, names)
        } else {
            Finding::advice(
                CHECK,
                format!("{names}: the first milliseconds of a sweep may be handled late"),
                "cpupower frequency-set -g performance",
            )
        }
    }

    /// Whether reading the clock is cheap and steady.
    pub(super) fn clock_source(&self) -> Finding {
        const CHECK: &str = "clock";
        match self.read("sys/devices/system/clocksource/clocksource0/current_clocksource") {
            Some(source) if GOOD_CLOCKS.contains(&source.as_str()) => Finding::good(CHECK, source),
            Some(source) => Finding::advice(
                CHECK,
                format!("{source}: slow to read, so lens positions are timed less exactly"),
                "see dmesg for why the kernel does not trust the processor's own; tsc=reliable on its command line if you do",
            ),
            None => Finding::advice(CHECK, "the kernel does not say which it uses", "mount /sys"),
        }
    }

    /// Whether the kernel ever lets real-time threads run.
    pub(super) fn real_time_share(&self) -> Finding {
        const CHECK: &str = "real-time share";
        let read = |name: &str| self.read(&format!("proc/sys/kernel/{name}"))?.parse::<f64>().ok();
        match (read("sched_rt_runtime_us"), read("sched_rt_period_us")) {
            (Some(0.0), _) => Finding::trouble(
                CHECK,
                "none: the kernel refuses SCHED_FIFO",
                "sysctl kernel.sched_rt_runtime_us=950000",
            ),
            (Some(runtime), Some(period)) if runtime > 0.0 => {
                Finding::good(CHECK, format!("{:.0} % of the time", 100.0 * runtime / period))
            }
            (Some(_), _) => Finding::good(CHECK, "all of the time"),
            (None, _) => Finding::advice(CHECK, "the kernel does not say", "mount /proc"),
        }
    }
}

/// Whether reports will find room in `state_dir`.
pub(super) fn disk(state_dir: &Path) -> Finding {
    const CHECK: &str = "disk";
    // The daemon makes the directory; until then its room is that of the nearest one that is there.
    let there = state_dir.ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("/"));
    let name = state_dir.display();
    match rustix::fs::statvfs(there) {
        Ok(disk) => {
            let mib = disk.f_bavail.saturating_mul(disk.f_frsize) >> 20;
            if disk.f_flag.contains(rustix::fs::StatVfsMountFlags::RDONLY) {
                let remedy = "mount it for writing, or name another directory with daemon.state_dir";
                Finding::trouble(CHECK, format!("{name} is on a read-only disk"), remedy)
            } else if mib < DISK_MIB {
                let remedy = "make room, or keep fewer reports (daemon.reports_kept)";
                Finding::trouble(CHECK, format!("{name}: {mib} MiB free"), remedy)
            } else {
                Finding::good(CHECK, format!("{name}: {mib} MiB free"))
            }
        }
        Err(error) => Finding::trouble(
            CHECK,
            format!("{name}: {error}"),
            "name a directory that the daemon can write to with daemon.state_dir",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Severity;
    use super::*;

    fn machine(files: &[(&str, &str)]) -> (tempfile::TempDir, Machine) {
        let root = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let machine = Machine::new(root.path());
        (root, machine)
    }

    #[test]
    fn a_bare_machine_has_trouble_with_a_camera_and_none_without() {
        let (_root, bare) = machine(&[]);
        for (finding, without) in
            [(bare.udev_rule(true), bare.udev_rule(false)), (bare.usb_memory(true), bare.usb_memory(false))]
        {
            assert_eq!((finding.severity, without.severity), (Severity::Trouble, Severity::Good));
            assert!(finding.remedy.is_some() && without.remedy.is_none());
        }
    }

    #[test]
    fn a_good_machine_has_nothing_to_remedy() {
        let (_root, good) = machine(&[
            ("usr/lib/udev/rules.d/70-evfocus.rules", ""),
            ("sys/module/usbcore/parameters/usbfs_memory_mb", "16\n"),
            ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
            ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
        ]);
        for finding in [
            good.udev_rule(true),
            good.usb_memory(true),
            good.governor(),
            good.clock_source(),
            good.real_time_share(),
        ] {
            assert_eq!(finding.severity, Severity::Good, "{finding:?}");
        }
        assert_eq!(good.real_time_share().found, "95 % of the time");
    }

    #[test]
    fn what_is_wrong_is_named_with_its_remedy() {
        let (_root, poor) = machine(&[
            ("sys/module/usbcore/parameters/usbfs_memory_mb", "2\n"),
            ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n"),
            ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance\n"),
            ("sys/devices/system/clocksource/clocksource0/current_clocksource", "acpi_pm\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "0\n"),
        ]);
        for (finding, severity, word) in [
            (poor.usb_memory(true), Severity::Trouble, "2 MiB"),
            (poor.governor(), Severity::Advice, "powersave"),
            (poor.clock_source(), Severity::Advice, "acpi_pm"),
            (poor.real_time_share(), Severity::Trouble, "none"),
        ] {
            assert_eq!(finding.severity, severity, "{finding:?}");
            assert!(finding.found.contains(word) && finding.remedy.is_some(), "{finding:?}");
        }
    }
}
