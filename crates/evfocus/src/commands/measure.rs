//! `evfocus measure`: how sharp pictures are, by eleven focus operators.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use evfocus_eval::{GreyImage, Operator};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::exit::Exit;
use crate::output::Output;

/// Say how sharp pictures are, by eleven focus operators
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus measure frame.png
  evfocus measure stack/*.png --json | jq '.[] | .operators.GRAD'

The operators are those that \"Autofocus for Event Cameras\" (Lin et al., CVPR 2022) compares with, as defined in Pertuz et al., \
\"Analysis of focus measure operators for shape-from-focus\" (2013). More is sharper; values of unlike operators do not compare.

Units: none; grey levels go from 0 to 1, and where the definitions sum the mean over the pixels is taken.")]
pub struct Arguments {
    /// Pictures: PNG, JPEG, PGM or TIFF; colours are turned to grey
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Print one JSON array instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Measured {
    image: String,
    width: usize,
    height: usize,
    /// By operator; nothing for one that needs a larger picture.
    operators: Map<String, Value>,
}

impl Measured {
    fn of(path: &Path) -> anyhow::Result<Self> {
        let image = GreyImage::read(path)?;
        let (width, height) = (image.width(), image.height());
        let operators = Operator::ALL.into_iter().map(|operator| {
            let fits = width.min(height) >= operator.smallest_side();
            (operator.name().to_owned(), if fits { operator.value(&image).into() } else { Value::Null })
        });
        Ok(Self { image: path.display().to_string(), width, height, operators: operators.collect() })
    }
}

/// Measures each picture. All are read before anything is printed, so that one that cannot be read does not go unnoticed.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let measured =
        arguments.images.iter().map(|path| Measured::of(path)).collect::<anyhow::Result<Vec<_>>>()?;
    let mut out = Output::new();
    if arguments.json {
        out.json(&measured)?;
        return Ok(Exit::of_run(true));
    }
    for picture in &measured {
        writeln!(out, "{} ({} x {})", picture.image, picture.width, picture.height)?;
        for (operator, value) in &picture.operators {
            match value.as_f64() {
                Some(value) => writeln!(out, "  {operator:<5} {value:.6e}")?,
                None => writeln!(out, "  {operator:<5} the picture is too small")?,
            }
        }
    }
    Ok(Exit::of_run(true))
}
