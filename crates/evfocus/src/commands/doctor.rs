//! `evfocus doctor`: what of this machine stands in the way, and what to do about it.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use evfocus_ipc::Status;
use evfocusd::Config;
use evfocusd::config::default_state_dir;
use evfocusd::doctor::{Finding, InUse, Severity, examine};
use serde_json::json;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// Check this machine, the configuration and the daemon, and say what to do about what is wrong
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus doctor
  evfocus doctor --config /etc/evfocus/evfocusd.toml

It looks at the camera, the lens's port, the udev rule, USB memory, the CPU governor, the clock, real-time limits, the disk and the \
daemon, and changes nothing. Run it as the user who uses the daemon.

Exit status: 0 nothing is wrong (there may be advice), 1 something is.")]
pub struct Arguments {
    /// The daemon's configuration; without one, /etc/evfocus/evfocusd.toml if it is there, else the simulated rig
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    socket: SocketArguments,
}

/// Where the package puts the configuration, and where its unit lets the daemon keep its state.
const INSTALLED: [&str; 2] = ["/etc/evfocus/evfocusd.toml", "/var/lib/evfocus"];

/// Examines and prints.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let status: anyhow::Result<Status> =
        block_on(async { Ok(connect(&arguments.socket).await?.status().await?) });
    let in_use = status.as_ref().map_or_else(
        |_| InUse::default(),
        |status| InUse { camera: status.camera.is_some(), lens: status.lens.is_some() },
    );
    let mut findings = machine(arguments, in_use);
    findings.extend(daemon(status));
    let worst = findings.iter().map(|finding| finding.severity).max().unwrap_or(Severity::Good);
    let mut out = Output::new();
    if arguments.socket.json {
        let list: Vec<_> = findings
            .iter()
            .map(|finding| {
                let severity = word(finding.severity);
                json!({ "check": finding.check, "severity": severity, "found": finding.found, "remedy": finding.remedy })
            })
            .collect();
        out.json(&json!({ "findings": list }))?;
    } else {
        for finding in &findings {
            writeln!(out, "{:<8} {:<16} {}", word(finding.severity), finding.check, finding.found)?;
            if let Some(remedy) = &finding.remedy {
                writeln!(out, "{:25} -> {remedy}", "")?;
            }
        }
    }
    Ok(if worst == Severity::Trouble { Exit::Error } else { Exit::Done })
}

fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Good => "good",
        Severity::Advice => "advice",
        Severity::Trouble => "trouble",
    }
}

fn machine(arguments: &Arguments, in_use: InUse) -> Vec<Finding> {
    const CHECK: &str = "configuration";
    let [installed, state] = INSTALLED.map(PathBuf::from);
    let path = arguments.config.clone().or_else(|| installed.exists().then(|| installed.clone()));
    let config = path.as_deref().map_or_else(Config::simulated, Config::read);
    match config {
        Ok(mut config) => {
            // The default is that of whoever asks; the daemon is told by its unit.
            if path.as_ref() == Some(&installed) && config.state_dir == default_state_dir() {
                config.state_dir = state;
            }
            let name =
                path.map_or_else(|| "none: the simulated rig".to_owned(), |path| path.display().to_string());
            [vec![Finding::good(CHECK, name)], examine(&config, in_use)].concat()
        }
        Err(error) => vec![Finding::trouble(
            CHECK,
            error.to_string(),
            "mend the file; `evfocusd check-config` tells when it is good",
        )],
    }
}

fn daemon(status: anyhow::Result<Status>) -> Vec<Finding> {
    const CHECK: &str = "daemon";
    let status = match status {
        Ok(status) => status,
        Err(error) => {
            let remedy = "systemctl start evfocusd, or name its socket with --socket; to use it, join the group evfocus";
            return vec![Finding::trouble(CHECK, error.to_string(), remedy)];
        }
    };
    let name = format!("version {}, up for {:.0} s", status.version, status.uptime_s);
    let mut findings = vec![match status.fault {
        None => Finding::good(CHECK, name),
        Some(fault) => Finding::trouble(CHECK, name, fault),
    }];
    findings.extend(status.real_time.into_iter().map(|grant| {
        let found = format!("{}: {}", grant.what, grant.asked);
        match grant.remedy {
            None => Finding::good("real time", found),
            Some(remedy) => Finding::trouble("real time", found, remedy),
        }
    }));
    if status.events_lost > 0 {
        findings.push(Finding::advice(
            "events",
            format!("{} lost since the daemon started", status.events_lost),
            "a faster USB port, fewer other devices on it, real time, or a rate limit in the camera",
        ));
    }
    findings
}
