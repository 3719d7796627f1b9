//! Every fault of a lens against every driver and the model of its device, in virtual time: what is said, how far the lens goes on, and
//! whether all is well again; as Markdown: `cargo run --release -p evfocus-tests --bin lens-faults`.
#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use anyhow::Result;
use evfocus_tests::lens_faults::{FAULTS, OPENINGS, open, strike};
use evfocus_tests::lenses::LENSES;

fn main() -> Result<()> {
    let names: Vec<_> = LENSES.iter().map(|lens| lens.name).collect();
    println!("## When the lens is opened\n\nWhat the driver says, by kind and in words.\n");
    println!("| fault | {} |", names.join(" | "));
    println!("| --- |{}", " --- |".repeat(names.len()));
    for opening in OPENINGS {
        let cells: Result<Vec<_>> =
            LENSES.iter().map(|lens| open(lens, opening).map(|said| said.replace('|', "\\|"))).collect();
        println!("| {} | {} |", opening.name(), cells?.join(" | "));
    }
    println!(
        "\n## In the middle of a sweep\n\nThe reason that the report of the run gives; how long the glass moves on after the fault, in \
         milliseconds, and what of that is its stopping time; the driver's words; and what a run after the repair comes to.\n"
    );
    println!("| fault | {} |", names.join(" | "));
    println!("| --- |{}", " --- |".repeat(names.len()));
    for fault in FAULTS {
        let cells: Vec<Result<String>> = std::thread::scope(|scope| {
            let cells: Vec<_> = LENSES
                .iter()
                .map(|lens| scope.spawn(move || strike(lens, fault).map(|came| came.to_string())))
                .collect();
            cells
                .into_iter()
                .map(|cell| cell.join().unwrap_or_else(|_| anyhow::bail!("a run panicked")))
                .collect()
        });
        let cells: Result<Vec<_>> = cells.into_iter().collect();
        println!("| {} | {} |", fault.name(), cells?.join(" | "));
    }
    Ok(())
}
