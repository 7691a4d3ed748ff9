//! Announcements between a server on SQLite and a process that it starts for one job. PostgreSQL passes them on itself.

use super::changes::Change;
use super::rows::from_json;
use super::{Result, Store};
use tokio::sync::mpsc;

/// The changes that a process makes, one line of text each, for [`Store::hear`] in the process that started it.
#[derive(Debug)]
pub struct PassedOn(mpsc::UnboundedReceiver<Change>);

impl Store {
    /// Passes on all changes that this process makes from now on; `None` if somebody receives them already.
    #[must_use]
    pub fn pass_on(&self) -> Option<PassedOn> {
        let (sender, receiver) = mpsc::unbounded_channel();
        self.inner.changes.passed_on.set(sender).is_ok().then_some(PassedOn(receiver))
    }

    /// Announces that a job may have changed, and with it what waits for it, because the process that changes it has ended.
    pub fn announce_job(&self, id: &str) {
        self.inner.changes.publish(vec![Change::Job(id.to_owned()), Change::Claimable, Change::Deliverable]);
    }

    /// Announces what a process said that this one started.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::Corrupt`] if the line is no change.
    pub fn hear(&self, line: &str) -> Result<()> {
        let change: Change = from_json("change", line)?;
        self.inner.changes.publish(vec![change]);
        Ok(())
    }
}

impl PassedOn {
    /// The next change; `None` when the store is closed.
    pub async fn next(&mut self) -> Option<String> {
        Some(line(&self.0.recv().await?))
    }

    /// The changes that nobody has received yet.
    pub fn rest(&mut self) -> impl Iterator<Item = String> + '_ {
        std::iter::from_fn(|| self.0.try_recv().ok().as_ref().map(line))
    }
}

fn line(change: &Change) -> String {
    serde_json::to_string(change).expect("a change is names and numbers")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Changed;

    #[tokio::test]
    async fn one_store_hears_what_another_one_changes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lightpath.db");
        let (told, hearing) = (Store::open(&path).await.unwrap(), Store::open(&path).await.unwrap());
        let mut passed_on = told.pass_on().unwrap();
        assert!(told.pass_on().is_none());
        let mut heard = hearing.subscribe_changes();
        told.pause(None, "maintenance", 1).await.unwrap();
        hearing.hear(&passed_on.next().await.unwrap()).unwrap();
        assert_eq!(heard.recv().await.unwrap(), Changed::Queue);
        told.pause(Some("lab"), "maintenance", 1).await.unwrap_err();
        told.resume(None).await.unwrap();
        assert_eq!(passed_on.rest().count(), 2, "the queue changed and jobs may be ready; what failed is no change");
        assert!(hearing.hear("no change").is_err());
    }
}
