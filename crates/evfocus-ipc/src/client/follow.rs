//! A call that is answered many times.

use std::fmt;
use std::marker::PhantomData;

use super::{Client, ClientError, results};
use crate::{Progress, Status};

/// What can be followed: [`Progress`] of a run, and [`Status`].
pub trait News: sealed::News + fmt::Debug {}

impl News for Progress {}
impl News for Status {}

mod sealed {
    use serde::de::DeserializeOwned;

    /// How the reply of the method is read.
    pub trait News: Sized {
        type Results: DeserializeOwned;
        fn from_results(results: Self::Results) -> Self;
    }
}

impl sealed::News for Progress {
    type Results = results::OfFocus;
    fn from_results(results: results::OfFocus) -> Self {
        results.progress
    }
}

impl sealed::News for Status {
    type Results = results::OfStatus;
    fn from_results(results: results::OfStatus) -> Self {
        results.status
    }
}

/// A run or the status, followed. It has the connection to itself; dropping it hangs up, which stops no run.
#[derive(Debug)]
pub struct Following<Item> {
    client: Client,
    ended: bool,
    item: PhantomData<Item>,
}

impl<Item: News> Following<Item> {
    pub(super) fn new(client: Client) -> Self {
        Self { client, ended: false, item: PhantomData }
    }

    /// The next news; nothing after the last, and nothing after an error. Cancel safe: it may stand in a `select!`.
    pub async fn next(&mut self) -> Result<Option<Item>, ClientError> {
        if self.ended {
            return Ok(None);
        }
        match self.client.receive::<Item::Results>().await {
            Ok((results, continues)) => {
                self.ended = !continues;
                Ok(Some(Item::from_results(results)))
            }
            Err(error) => {
                self.ended = true;
                Err(error)
            }
        }
    }
}
