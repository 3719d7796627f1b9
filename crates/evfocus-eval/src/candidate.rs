//! The methods that are compared.

use std::fmt;

use evfocus_core::Method;

use crate::Operator;

/// A way to find focus in a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Candidate {
    /// The highest value of an operator among pictures made from events.
    OnEvents(Operator),
    /// The highest value of an operator among frames.
    OnFrames(Operator),
    /// The highest event rate at a fixed accumulation interval, milliseconds.
    FixedInterval(u64),
    /// A search of the core.
    Search(Method),
    /// `auto` of a rig whose delay earlier runs have taught.
    Taught,
}

/// The accumulation intervals of the paper's Algorithm 1, milliseconds.
const INTERVALS_MS: [u64; 2] = [55, 65];

impl Candidate {
    /// Every candidate: the operators, then the searches of the core in its order.
    pub fn all() -> Vec<Self> {
        let operators = |on: fn(Operator) -> Self| Operator::ALL.into_iter().map(on);
        operators(Self::OnEvents).chain(operators(Self::OnFrames)).chain(Self::searches()).collect()
    }

    /// The candidates that look at events as they are, whatever methods the core has.
    pub fn searches() -> Vec<Self> {
        let fixed = INTERVALS_MS.map(Self::FixedInterval);
        let others = Method::ALL.into_iter().filter(|method| *method != Method::ErFixed).map(Self::Search);
        fixed.into_iter().chain(others).chain([Self::Taught]).collect()
    }

    /// Its name in the paper's tables, if it is in one.
    pub fn name_in_paper(self) -> Option<&'static str> {
        match self {
            Self::OnEvents(operator) | Self::OnFrames(operator) => Some(operator.name()),
            Self::FixedInterval(55) => Some("ER dt=0.055"),
            Self::FixedInterval(65) => Some("ER dt=0.065"),
            Self::Search(Method::Egs) => Some("ER + EGS"),
            Self::FixedInterval(_) | Self::Search(_) | Self::Taught => None,
        }
    }
}

impl fmt::Display for Candidate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OnEvents(operator) => write!(f, "{operator} (events)"),
            Self::OnFrames(operator) => write!(f, "{operator} (frames)"),
            Self::FixedInterval(milliseconds) => write!(f, "er-fixed {milliseconds} ms"),
            Self::Search(method) => f.write_str(method.name()),
            Self::Taught => f.write_str("auto, delay learnt"),
        }
    }
}
