//! Admission, in front of every handler, identifies the caller, refuses calls that are not allowed, and writes the audit
//! log.
//!
//! A handler runs as a task of its own. When the client leaves, the call is cancelled: computations stop waiting, and a
//! change that has begun runs to its end. So the audit log knows the outcome of every call.

use super::known_tokens::KnownTokens;
use super::origin::Hosts;
use super::protocol::{is_grpc, require_grpc};
use super::refusal::{RefusalCode, refuse};
use super::token_expiry::{EndedTokens, ending_at_expiry, not_accepted};
use super::transcode::Called;
use crate::accounts::Rate;
use crate::api::Api;
use crate::audit::{Audit, Change, Refusal};
use crate::connections::Peer;
use crate::rules::{Access, Effect, Rule, WRONG_VERB, rule_of};
use crate::status;
use crate::time::now_ms;
use axum::Extension;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::Response;
use lightpath_domain::access::{Caller, Secret};
use lightpath_proto::code_name;
use lightpath_service::{Call, Client, LimitReason, Result, ServiceError};
use lightpath_store::{Store, for_client};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Code, Status};
use tracing::Instrument as _;

/// Name in the audit log of all paths that no rule knows. Their own names could be long and many.
const UNKNOWN_PATH: &str = "unknown path";

/// Settings and state of admission.
#[derive(Clone, Debug)]
pub struct Admission {
    /// The services behind admission.
    pub api: Api,
    /// Whether calls need a token.
    pub tokens_required: bool,
    /// Names to which the server answers.
    pub hosts: Hosts,
    /// Audit log of changes and refusals.
    pub audit: Arc<Audit>,
    /// Rate limit of each client.
    pub rate: Arc<Rate>,
    /// Tokens that are no longer accepted.
    pub ended_tokens: EndedTokens,
    /// Tokens that were accepted lately.
    pub known_tokens: KnownTokens,
}

/// A request as admission sees it.
struct Visit {
    /// `None` in tests without a connection.
    peer: Option<Peer>,
    /// Method or route, for the audit log.
    name: String,
    rule: Option<Rule>,
    is_grpc: bool,
}

impl Visit {
    fn of(request: &Request, peer: Option<Peer>) -> Self {
        let path = request.uri().path();
        let is_grpc = is_grpc(path);
        if let Some(called) = request.extensions().get::<Called>() {
            let rule = called.method().map_or(Some(WRONG_VERB), |method| rule_of(method, None));
            return Self { peer, name: called.method().unwrap_or(UNKNOWN_PATH).to_owned(), rule, is_grpc };
        }
        let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
        let rule = rule_of(path, route);
        let known = rule.map(|_| route.filter(|route| !route.contains("{*")).unwrap_or(path));
        Self { peer, name: known.unwrap_or(UNKNOWN_PATH).to_owned(), rule, is_grpc }
    }

    /// Whether every client may make the call, without a token and a limit.
    fn is_open(&self) -> bool {
        self.rule.is_some_and(|rule| rule.access == Access::Everyone)
    }

    fn ip(&self) -> Option<IpAddr> {
        self.peer.as_ref().map(Peer::ip)
    }

    fn address(&self) -> String {
        self.ip().map(|address| address.to_string()).unwrap_or_default()
    }
}

/// Passes a request to its handler, or refuses it.
pub(super) async fn pass(
    State(admission): State<Admission>,
    peer: Option<Extension<Peer>>,
    mut request: Request,
    next: Next,
) -> Response {
    let visit = Visit::of(&request, peer.map(|Extension(peer)| peer));
    let caller = match admission.check(&request, &visit) {
        Ok(()) => admission.admit(request.headers(), &visit).await,
        Err(status) => Err((String::new(), status)),
    };
    let caller = match caller {
        Ok(caller) => caller,
        Err((name, status)) => {
            admission.note_refusal(&visit, name, status.code());
            return refuse(status, visit.is_grpc);
        }
    };
    let call = Call::new(caller, visit.ip());
    request.extensions_mut().insert(call.clone());
    // Dropped, and so cancelled, when the client leaves.
    let _waiting = call.cancelled.clone().drop_guard();
    let is_grpc = visit.is_grpc;
    let handled = tokio::spawn(handle(admission, visit, call, next.run(request)).in_current_span());
    handled.await.unwrap_or_else(|error| refuse(status::of(ServiceError::Task(error)), is_grpc))
}

/// Runs the handler of a call until it ends or its token is no longer accepted, and writes the audit log.
async fn handle(admission: Admission, visit: Visit, call: Call, handler: impl Future<Output = Response>) -> Response {
    let mut expiry = admission.ended_tokens.when_ended(&call.caller.name);
    let handler = for_client(call.client.line(), handler);
    let response = tokio::select! {
        response = handler => ending_at_expiry(response, expiry, visit.is_grpc),
        () = &mut expiry => refuse(status::of(not_accepted()), visit.is_grpc),
    };
    admission.note(&visit, &call, code_of(&response, visit.is_grpc));
    response
}

impl Admission {
    /// Refuses a request that may come from a web page of another site. Open calls may use any name of the server.
    fn check(&self, request: &Request, visit: &Visit) -> Result<(), Status> {
        let named = if visit.is_open() { Ok(()) } else { self.hosts.check(request) };
        let checked = named.and_then(|()| if visit.is_grpc { require_grpc(request) } else { Ok(()) });
        checked.map_err(|error| self.limited(visit, error))
    }

    /// Counts a refused call towards the rate limit of its address, so that clients cannot try many tokens. Returns the
    /// error, or that of the limit.
    fn limited(&self, visit: &Visit, error: Status) -> Status {
        self.limit_rate(&Client::at(visit.ip())).err().map_or(error, status::of)
    }

    /// Returns the caller if the call is allowed and within the rate limit, and the disk has room for new work (if the
    /// call creates any). Otherwise returns the name of the token, or an empty name, and the status.
    async fn admit(&self, headers: &HeaderMap, visit: &Visit) -> Result<Caller, (String, Status)> {
        if visit.is_open() {
            return Ok(Caller::without_token());
        }
        let caller = self.identified(headers, visit).await.map_err(|status| (String::new(), status))?;
        let allowed = allowed(&caller, visit.rule);
        allowed.map_err(|error| (caller.name.clone(), self.limited(visit, status::of(error))))?;
        let room = |()| match visit.rule {
            Some(Rule { effect: Effect::Creates, .. }) => Ok(self.api.artifacts.space().room_for_new_work()?),
            _ => Ok(()),
        };
        let client = Client::of(&caller, visit.ip());
        let counted = |()| visit.peer.as_ref().map_or(Ok(()), |peer| peer.count(&self.api.streams, &client));
        let admitted = self.limit_rate(&client).and_then(counted).and_then(room);
        admitted.map_err(|error| (caller.name.clone(), status::of(error)))?;
        Ok(caller)
    }

    fn limit_rate(&self, client: &Client) -> Result<()> {
        self.rate.admit(client, Instant::now()).map_err(|retry_after| ServiceError::Exhausted {
            reason: LimitReason::RateLimited,
            message: "too many calls; retry after the delay".to_owned(),
            retry_after,
        })
    }

    /// Writes the outcome of a call to the audit log: a change, or a refusal by the handler.
    fn note(&self, visit: &Visit, call: &Call, code: Code) {
        let changes = visit.rule.is_some_and(|rule| rule.effect != Effect::Reads);
        // A request that never arrived as a whole names no object.
        let is_refused = is_refusal(code) || (code != Code::Ok && call.object().is_empty());
        if changes && !is_refused {
            self.audit.change(&Change {
                caller: call.caller.name.clone(),
                address: visit.address(),
                call: visit.name.clone(),
                object: call.object().to_owned(),
                outcome: code_name(code).to_owned(),
            });
        } else if changes || matches!(code, Code::PermissionDenied | Code::Unauthenticated) {
            self.note_refusal(visit, call.caller.name.clone(), code);
        }
    }

    fn note_refusal(&self, visit: &Visit, caller: String, code: Code) {
        let (address, call) = (visit.address(), visit.name.clone());
        self.audit.refusal(Refusal { caller, address, call, outcome: code_name(code).to_owned() });
    }

    /// The caller with the token of a request. A refusal counts towards the rate limit of the address.
    async fn identified(&self, headers: &HeaderMap, visit: &Visit) -> Result<Caller, Status> {
        let refused = |error| self.limited(visit, status::of(error));
        let Some(secret) = bearer(headers).map_err(refused)? else {
            if !self.tokens_required {
                return Ok(Caller::without_token());
            }
            let message = "this server requires a token: send `authorization: Bearer …`, or use --token-file FILE of the \
                           command line";
            return Err(refused(ServiceError::Unauthenticated(message.to_owned())));
        };
        let hash = secret.hash();
        let is_known = self.known_tokens.contains(&hash);
        if !is_known {
            // Before the search, which is what a limit shall spare the database.
            self.limit_rate(&Client::at(visit.ip())).map_err(status::of)?;
        }
        // Whose token it is, is not known yet. Unknown tokens share the line of their address, or each would have a new one.
        let line = if is_known { hash.as_str().into() } else { Client::at(visit.ip()).line() };
        let found = for_client(line, find(&self.api.store, &hash)).await;
        self.known_tokens.note(&hash, found.is_ok());
        found.map_err(|error| if is_known { refused(error) } else { status::of(error) })
    }
}

/// Checks that the role of a caller allows a call.
fn allowed(caller: &Caller, rule: Option<Rule>) -> Result<()> {
    match rule.map(|rule| rule.access) {
        Some(Access::Everyone) => Ok(()),
        // Without tokens, the caller may do everything that exists; what does not exist is found missing later.
        _ if caller.name.is_empty() => Ok(()),
        Some(Access::Only(roles)) if roles.contains(&caller.role) => Ok(()),
        Some(Access::Only(roles)) => {
            let roles: Vec<&str> = roles.iter().map(|role| role.as_str()).collect();
            let message = format!(
                "the token \"{}\" has the role {}, but the call requires one of: {}",
                caller.name,
                caller.role.as_str(),
                roles.join(", ")
            );
            Err(ServiceError::Denied(message))
        }
        None => Err(ServiceError::Denied("this path does not exist, or no role may call it".to_owned())),
    }
}

/// The token in the headers of a request.
fn bearer(headers: &HeaderMap) -> Result<Option<Secret>> {
    let Some(value) = headers.get(header::AUTHORIZATION) else { return Ok(None) };
    let text = value.to_str().ok().and_then(|text| text.split_once(' '));
    match text {
        Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") && !token.trim().is_empty() => {
            Ok(Some(Secret::from_text(token.trim())))
        }
        _ => Err(ServiceError::Unauthenticated("the header authorization must be `Bearer` and a token".to_owned())),
    }
}

/// The caller whose token has this hash, if the token is accepted now. All refusals are equal, so that they reveal nothing.
async fn find(store: &Store, hash: &str) -> Result<Caller> {
    let record = store.token_by_hash(hash).await?;
    let valid = record.filter(|record| record.is_valid(now_ms()));
    valid.map(|record| record.caller).ok_or_else(not_accepted)
}

/// Whether a handler that answers with this code has changed nothing.
fn is_refusal(code: Code) -> bool {
    use Code::{DataLoss, DeadlineExceeded, Internal, Ok, Unavailable, Unknown};
    !matches!(code, Ok | Unknown | DeadlineExceeded | Internal | Unavailable | DataLoss)
}

/// The code of the answer as far as it is known when the answer starts.
fn code_of(response: &Response, is_grpc: bool) -> Code {
    if is_grpc {
        return response.headers().get("grpc-status").map_or(Code::Ok, |status| Code::from_bytes(status.as_bytes()));
    }
    let is_error = response.status().is_client_error() || response.status().is_server_error();
    // The router refuses a wrong verb without a code.
    let without_code = if is_error { Code::Unknown } else { Code::Ok };
    response.extensions().get::<RefusalCode>().map_or(without_code, |refusal| refusal.0)
}
