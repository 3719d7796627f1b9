//! The lines of the house, as ARCHITECTURE.md draws them, held against the manifests and sources.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// Which crate of the project may depend on which. Development dependencies are free.
const ARROWS: [(&str, &[&str]); 11] = [
    ("evfocus-core", &[]),
    ("evfocus-ipc", &[]),
    ("evfocus-hal", &["evfocus-core"]),
    ("evfocus-camera", &["evfocus-core", "evfocus-hal"]),
    ("evfocus-lens", &["evfocus-core", "evfocus-hal"]),
    ("evfocus-record", &["evfocus-core", "evfocus-hal"]),
    ("hil-sim", &["evfocus-core", "evfocus-hal"]),
    ("evfocus-eval", &["evfocus-core", "evfocus-hal", "evfocus-record", "hil-sim"]),
    (
        "evfocusd",
        &[
            "evfocus-camera",
            "evfocus-core",
            "evfocus-hal",
            "evfocus-ipc",
            "evfocus-lens",
            "evfocus-record",
            "hil-sim",
        ],
    ),
    (
        "evfocus",
        &[
            "evfocus-core",
            "evfocus-eval",
            "evfocus-hal",
            "evfocus-ipc",
            "evfocus-record",
            "evfocusd",
            "hil-sim",
        ],
    ),
    (
        "evfocus-tests",
        &[
            "evfocus-camera",
            "evfocus-core",
            "evfocus-eval",
            "evfocus-hal",
            "evfocus-ipc",
            "evfocus-lens",
            "evfocus-record",
            "evfocusd",
            "hil-sim",
        ],
    ),
];

/// Longest way from a crate to one without dependencies of the project.
const LONGEST_CHAIN: usize = 4;

/// Crates that only the named crates of the project may depend on.
const FENCES: [(&str, &[&str]); 8] = [
    ("nusb", &["evfocus-camera"]),
    ("tokio", &["evfocus-ipc", "evfocusd", "evfocus"]),
    ("serde", &["evfocus-eval", "evfocus-ipc", "evfocusd", "evfocus"]),
    ("clap", &["evfocusd", "evfocus", "hil-sim"]),
    ("serialport", &["evfocus-lens"]),
    ("plotters", &["evfocus-eval", "evfocus"]),
    ("image", &["evfocus-eval"]),
    ("rand", &["evfocus-eval", "evfocus-tests", "hil-sim"]),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().map(Path::to_owned).unwrap_or_default()
}

/// Name and dependencies of each crate of the workspace.
fn manifests() -> Result<BTreeMap<String, BTreeSet<String>>> {
    let mut folders = vec![root().join("hil-sim"), root().join("tests")];
    for entry in std::fs::read_dir(root().join("crates"))? {
        folders.push(entry?.path());
    }
    let mut found = BTreeMap::new();
    for folder in folders {
        let path = folder.join("Cargo.toml");
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let manifest: toml::Table = toml::from_str(&text).with_context(|| path.display().to_string())?;
        let name = manifest.get("package").and_then(|package| package.get("name")?.as_str());
        let name = name.with_context(|| format!("{}: no name", path.display()))?;
        let dependencies = manifest.get("dependencies").and_then(toml::Value::as_table);
        let names = dependencies.map(|table| table.keys().cloned().collect()).unwrap_or_default();
        found.insert(name.to_owned(), names);
    }
    Ok(found)
}

#[test]
fn arrows_are_those_of_the_plan() -> Result<()> {
    let manifests = manifests()?;
    let planned: BTreeMap<_, BTreeSet<_>> =
        ARROWS.iter().map(|(name, on)| (*name, on.iter().copied().collect())).collect();
    let ours: BTreeSet<_> = manifests.keys().map(String::as_str).collect();
    assert_eq!(ours, planned.keys().copied().collect(), "the crates of the workspace");
    for (name, dependencies) in &manifests {
        let inner: BTreeSet<_> =
            dependencies.iter().map(String::as_str).filter(|name| ours.contains(name)).collect();
        let allowed = planned.get(name.as_str()).context("in the plan")?;
        let surplus: Vec<_> = inner.difference(allowed).collect();
        assert!(surplus.is_empty(), "{name} must not depend on {surplus:?}");
    }
    Ok(())
}

#[test]
fn no_chain_is_longer_than_four() -> Result<()> {
    fn depth(name: &str, manifests: &BTreeMap<String, BTreeSet<String>>, seen: usize) -> Result<usize> {
        if seen > manifests.len() {
            bail!("{name} depends on itself");
        }
        let mut deepest = 0;
        for on in manifests.get(name).into_iter().flatten().filter(|on| manifests.contains_key(*on)) {
            deepest = deepest.max(1 + depth(on, manifests, seen + 1)?);
        }
        Ok(deepest)
    }
    let manifests = manifests()?;
    for name in manifests.keys().filter(|name| *name != "evfocus-tests") {
        let depth = depth(name, &manifests, 0)?;
        assert!(depth <= LONGEST_CHAIN, "{name} stands on a chain of {depth}");
    }
    Ok(())
}

#[test]
fn libraries_stay_behind_their_fences() -> Result<()> {
    for (name, dependencies) in manifests()? {
        for (library, allowed) in FENCES {
            let fenced = dependencies.contains(library) && !allowed.contains(&name.as_str());
            assert!(!fenced, "{name} must not depend on {library}");
        }
    }
    Ok(())
}

/// All Rust sources under `folder`.
fn sources(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(sources(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    Ok(found)
}

#[test]
fn the_core_is_pure() -> Result<()> {
    let core = root().join("crates/evfocus-core/src");
    let lib = std::fs::read_to_string(core.join("lib.rs"))?;
    assert!(lib.contains("#![no_std]"), "the compiler keeps the core pure");
    for path in sources(&core)? {
        let text = std::fs::read_to_string(&path)?;
        for (number, line) in text.lines().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            let impure = ["std::", "extern crate std", "unsafe "].iter().find(|word| code.contains(*word));
            let in_tests =
                path.ends_with("lib.rs") || path.components().any(|part| part.as_os_str() == "tests");
            assert!(impure.is_none() || in_tests, "{}:{}: {line}", path.display(), number + 1);
        }
    }
    Ok(())
}

#[test]
fn no_file_is_longer_than_seven_hundred_lines() -> Result<()> {
    for folder in ["crates", "hil-sim", "tests"] {
        for path in sources(&root().join(folder))? {
            let lines = std::fs::read_to_string(&path)?.lines().count();
            assert!(lines <= 700, "{} has {lines} lines", path.display());
        }
    }
    Ok(())
}

#[test]
fn exceptions_to_lints_carry_reasons() -> Result<()> {
    for folder in ["crates", "hil-sim", "tests"] {
        for path in sources(&root().join(folder))? {
            let text = std::fs::read_to_string(&path)?;
            let bare = ["#[", "#!["].iter().any(|start| text.contains(&format!("{start}allow(")));
            assert!(!bare, "{}: use expect with a reason", path.display());
        }
    }
    Ok(())
}

#[test]
fn the_security_page_names_what_there_is() -> Result<()> {
    let mut code = String::new();
    for folder in ["crates", "hil-sim", "tests"] {
        for path in sources(&root().join(folder))? {
            code += &std::fs::read_to_string(path)?;
        }
    }
    let page = std::fs::read_to_string(root().join("docs/security.md"))?;
    let (mut files, mut tests) = (0, 0);
    for name in page.split('`').skip(1).step_by(2) {
        let is_file = ["evfocus", "tests/", "config/", "fuzz/"].iter().any(|start| name.starts_with(start));
        if is_file && name.contains('/') && !name.contains(' ') {
            files += 1;
            let is_there = [root(), root().join("crates")].iter().any(|folder| folder.join(name).exists());
            assert!(is_there, "there is no {name}");
        } else if name.matches('_').count() > 2 && name.chars().all(|c| c == '_' || c.is_ascii_lowercase()) {
            tests += 1;
            assert!(code.contains(&format!("fn {name}(")), "there is no test {name}");
        }
    }
    assert!(files > 15 && tests > 10, "{files} files and {tests} tests are named");
    Ok(())
}
