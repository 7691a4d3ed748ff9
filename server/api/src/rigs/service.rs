//! The rig service.

use super::messages;
use crate::accounts::{OpenStream, StreamKind};
use crate::api::Api;
use crate::call::{Answers, answers};
use crate::names;
use futures::{StreamExt as _, stream};
use lightpath_domain::reason::PreconditionReason;
use lightpath_proto::v1;
use lightpath_proto::v1::rig_service_server::RigService;
use lightpath_proto::v1::serve_rig_request::Message;
use lightpath_proto::v1::{serve_rig_response, serve_rig_response::Connected};
use lightpath_rigs::{Refusal, Rigs, Session};
use lightpath_service::{Call, Field, Result, ServiceError};
use lightpath_store::for_client;
use std::time::Duration;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::Streaming;

/// How long a rig may take to describe its bench.
const DESCRIPTION_MAX: Duration = Duration::from_secs(20);

answers! {
    RigService {
        list_rigs(v1::ListRigsRequest) -> v1::ListRigsResponse;
    }
    streams {
        serve_rig(Streaming<v1::ServeRigRequest>) -> v1::ServeRigResponse as ServeRigStream;
    }
}

/// The stream of a connected rig.
struct Serving {
    api: Api,
    call: Call,
    session: Session,
    said: Streaming<v1::ServeRigRequest>,
    stopping: CancellationToken,
    /// Whether `connected` was sent.
    greeted: bool,
    has_ended: bool,
    _open: OpenStream,
}

impl Api {
    /// The connected rigs; workers ask them for photographs.
    #[must_use]
    pub fn rigs(&self) -> Rigs {
        self.rigs.clone()
    }

    async fn list_rigs(&self, call: &Call, _: v1::ListRigsRequest) -> Result<v1::ListRigsResponse> {
        let visible = self.rigs.list().into_iter().filter(|(display, _)| call.caller.may_use(display));
        Ok(v1::ListRigsResponse { rigs: visible.map(|(display, rig)| messages::rig(&display, rig)).collect() })
    }

    async fn serve_rig(
        &self,
        call: &Call,
        mut said: Streaming<v1::ServeRigRequest>,
    ) -> Result<Answers<v1::ServeRigResponse>> {
        let open = self.streams.open(StreamKind::Watch, &call.client)?;
        let first = timeout(DESCRIPTION_MAX, next(&mut said)).await;
        let field = Field::new("description");
        let Some(Message::Description(rig)) = first.map_err(|_| ServiceError::Idle(DESCRIPTION_MAX))?? else {
            return Err(field.but("is missing", "must be in the first message"));
        };
        let id = names::rig_display(call, &field.at("name"), &rig.name)?;
        call.concerns(&rig.name);
        let display = self.service.displays.named(&field.at("name"), &id).await?;
        let description = messages::description(&field, rig, &display)?;
        let session = self.rigs.connect(&display.id, description, &call.client.to_string()).map_err(|refusal| {
            let reason = match refusal {
                Refusal::Busy { .. } => PreconditionReason::RigBusy,
                Refusal::NoJobs => PreconditionReason::NoJobsHere,
            };
            ServiceError::Precondition { reason, message: format!("displays/{id}: {refusal}") }
        })?;
        let (api, call, stopping) = (self.clone(), call.clone(), self.stopping.clone());
        let serving = Serving { api, call, session, said, stopping, greeted: false, has_ended: false, _open: open };
        let answers = stream::unfold(serving, |mut serving| async move {
            if serving.has_ended {
                return None;
            }
            let asked = serving.asked().await.transpose()?;
            serving.has_ended = asked.is_err();
            Some((asked, serving))
        });
        Ok(answers.boxed())
    }
}

impl Serving {
    /// What is asked next of the rig, while its answers are handed over; `None`: the rig has ended the stream.
    async fn asked(&mut self) -> Result<Option<v1::ServeRigResponse>> {
        if !self.greeted {
            self.greeted = true;
            let message = Some(serve_rig_response::Message::Connected(Connected {}));
            return Ok(Some(v1::ServeRigResponse { message }));
        }
        loop {
            tokio::select! {
                biased;
                () = self.stopping.cancelled() => return Err(ServiceError::Stopping),
                said = next(&mut self.said) => match said? {
                    None => return Ok(None),
                    Some(message) => {
                        let line = self.call.client.line();
                        for_client(line, heard(&self.api, &self.call, &self.session, message)).await?;
                    }
                },
                ask = self.session.next() => {
                    let Some(ask) = ask else { return Err(replaced()) };
                    return Ok(Some(messages::ask(ask)));
                }
            }
        }
    }
}

/// Hands over an answer of a rig.
async fn heard(api: &Api, call: &Call, session: &Session, message: Message) -> Result<()> {
    let (take, answer) = match message {
        Message::Description(_) => {
            return Err(Field::new("description").but("is in a later message", "must be in the first message only"));
        }
        Message::Taken(taken) => {
            let field = Field::new("taken");
            let (take, taken) = messages::taken(&field, taken)?;
            api.service.files.require_picture(call, &field.at("photo"), &taken.photo).await?;
            (take, Ok(taken))
        }
        Message::Failed(failed) => {
            let (take, failure) = messages::failed(&Field::new("failed"), failed)?;
            (take, Err(failure))
        }
    };
    session.answered(&take, answer);
    Ok(())
}

async fn next(said: &mut Streaming<v1::ServeRigRequest>) -> Result<Option<Message>> {
    match said.next().await {
        None => Ok(None),
        Some(Err(status)) => Err(ServiceError::Stream(Box::new(status))),
        Some(Ok(request)) => Ok(Some(Field::new("message").required(request.message)?)),
    }
}

fn replaced() -> ServiceError {
    let message =
        "another connection of the same token serves this display now; run one rig for each display".to_owned();
    ServiceError::Precondition { reason: PreconditionReason::RigReplaced, message }
}
