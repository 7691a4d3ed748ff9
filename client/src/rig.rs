//! The stream between a program at a bench, a rig, and the server.

use crate::{Client, Error, Result, v1};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use v1::serve_rig_request::Message;

/// Messages that may wait to be sent. A rig answers one request at a time, so more mean that the connection stands still.
const WAITING_MAX: usize = 64;

/// The open stream of a rig. It ends when it is dropped.
#[derive(Debug)]
pub struct RigStream {
    client: Client,
    to_server: mpsc::Sender<v1::ServeRigRequest>,
    from_server: Streaming<v1::ServeRigResponse>,
}

impl Client {
    /// Opens the stream with which a rig serves the bench of a display, and sends the description of the bench.
    ///
    /// The stream ends when the connection is lost; open another one then.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the rig, [`Error::Unreachable`] when no server answers.
    pub async fn serve_rig(&self, description: v1::Rig) -> Result<RigStream> {
        let (to_server, messages) = mpsc::channel(WAITING_MAX);
        // The description goes first, before the server answers: the channel is empty and takes it at once.
        let _ = to_server.try_send(message(Message::Description(description)));
        let answer = self.rigs().serve_rig(ReceiverStream::new(messages)).await;
        let from_server = answer.map_err(|status| self.error(status))?.into_inner();
        Ok(RigStream { client: self.clone(), to_server, from_server })
    }
}

impl RigStream {
    /// Sends an answer. If the connection is lost the answer is lost, too, and [`Self::next`] says so.
    ///
    /// # Errors
    ///
    /// [`Error::Protocol`] when the server has not taken the last answers: the connection stands still.
    pub fn answer(&self, answer: Message) -> Result<()> {
        match self.to_server.try_send(message(answer)) {
            Ok(()) | Err(mpsc::error::TrySendError::Closed(_)) => Ok(()),
            Err(mpsc::error::TrySendError::Full(_)) => {
                Err(Error::Protocol { what: "it does not take a rig's answers" })
            }
        }
    }

    /// Waits for what the server says next; `None`: it has ended the stream. No message is lost if the wait is given up.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server ends the stream with a reason, [`Error::Unreachable`] when the connection is
    /// lost.
    pub async fn next(&mut self) -> Result<Option<v1::ServeRigResponse>> {
        self.from_server.message().await.map_err(|status| self.client.error(status))
    }
}

fn message(message: Message) -> v1::ServeRigRequest {
    v1::ServeRigRequest { message: Some(message) }
}
