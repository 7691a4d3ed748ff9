//! The gate in front of every handler identifies the caller, refuses calls that are not allowed, and writes the audit
//! log.

use super::rate::Rate;
use super::refusal::{code_name, refuse};
use super::token_expiry::{EndedTokens, ending_at_expiry, not_accepted};
use crate::api::Api;
use crate::audit::{Audit, Entry};
use crate::connections::Peer;
use crate::error::{ApiError, LimitReason};
use crate::rules::{Access, Effect, Rule, rule_of};
use crate::time::now_ms;
use axum::Extension;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::Response;
use lightpath_domain::access::{Caller, Secret};
use lightpath_store::Store;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Code, Status};

/// Settings and state of the gate.
#[derive(Clone, Debug)]
pub struct Gate {
    /// The services behind the gate.
    pub api: Api,
    /// Whether calls need a token.
    pub tokens_required: bool,
    /// Audit log of changes and refusals.
    pub audit: Arc<Audit>,
    /// Rate limit of each token, or of each address without a token.
    pub rate: Arc<Rate>,
    /// Tokens that are no longer accepted.
    pub ended_tokens: EndedTokens,
}

/// Passes a request to its handler, or refuses it.
pub(super) async fn pass(
    State(gate): State<Gate>,
    peer: Option<Extension<Peer>>,
    mut request: Request,
    next: Next,
) -> Response {
    let is_grpc = is_grpc(request.headers());
    let path = request.uri().path().to_owned();
    let route = request.extensions().get::<MatchedPath>().map(|route| route.as_str().to_owned());
    let ip = peer.as_ref().map(|Extension(peer)| peer.ip());
    let peer = peer.map(|Extension(peer)| peer.to_string()).unwrap_or_default();
    let entry = |caller: &str, outcome: &str| Entry {
        caller: caller.to_owned(),
        peer: peer.clone(),
        call: path.clone(),
        outcome: outcome.to_owned(),
    };
    let rule = rule_of(&path, route.as_deref());
    let address = ip.map(|ip| ip.to_string()).unwrap_or_default();
    let caller = match gate.admit(request.headers(), rule, &address).await {
        Ok(caller) => caller,
        Err((name, error)) => {
            let status = Status::from(error);
            if status.code() != Code::ResourceExhausted {
                gate.audit.write(entry(&name, code_name(status.code())));
            }
            return refuse(status, is_grpc);
        }
    };
    let name = caller.name.clone();
    request.extensions_mut().insert(caller);
    let mut expiry = gate.ended_tokens.when_ended(&name);
    let response = tokio::select! {
        response = next.run(request) => {
            if is_grpc && !name.is_empty() { ending_at_expiry(response, expiry) } else { response }
        }
        () = &mut expiry => refuse(not_accepted().into(), is_grpc),
    };
    let code = code_of(&response, is_grpc);
    let mutates = rule.is_some_and(|rule| rule.effect != Effect::Reads);
    if mutates || matches!(code, Code::PermissionDenied | Code::Unauthenticated) {
        gate.audit.write(entry(&name, code_name(code)));
    }
    response
}

impl Gate {
    /// Returns the caller if the call is allowed and within the rate limit, and the disk has room for new work (if the
    /// call creates any). Otherwise returns the error and the name of the token, or an empty name.
    async fn admit(
        &self,
        headers: &HeaderMap,
        rule: Option<Rule>,
        address: &str,
    ) -> Result<Caller, (String, ApiError)> {
        let caller = self.caller(headers, rule).await.map_err(|(name, error)| {
            // Calls with wrong tokens count towards the rate limit, so that clients cannot try many.
            (name, self.limit_rate(address).err().unwrap_or(error))
        })?;
        let name_or_address = if caller.name.is_empty() { address } else { &caller.name };
        let admitted = self.limit_rate(name_or_address).and_then(|()| match rule {
            Some(Rule { effect: Effect::Creates, .. }) => Ok(self.api.artifacts.space().admit(0)?),
            _ => Ok(()),
        });
        admitted.map_err(|error| (caller.name.clone(), error))?;
        Ok(caller)
    }

    fn limit_rate(&self, name_or_address: &str) -> Result<(), ApiError> {
        self.rate.admit(name_or_address, Instant::now()).map_err(|retry_after| ApiError::Exhausted {
            reason: LimitReason::RateLimited,
            message: "too many calls; retry after the delay".to_owned(),
            retry_after,
        })
    }

    /// Returns the caller if the role allows the call. Otherwise returns the error and the name of the token, or an
    /// empty name.
    async fn caller(&self, headers: &HeaderMap, rule: Option<Rule>) -> Result<Caller, (String, ApiError)> {
        let unnamed = |error: ApiError| (String::new(), error);
        let token = bearer(headers).map_err(unnamed)?;
        let caller = match token {
            Some(secret) => find(&self.api.store, &secret).await.map_err(unnamed)?,
            None if !self.tokens_required => return Ok(Caller::without_token()),
            None if rule.is_some_and(|rule| rule.access == Access::Everyone) => return Ok(Caller::without_token()),
            None => {
                let message = "this server requires a token: send `authorization: Bearer …`, or use --token-file FILE \
                               of the command line";
                return Err(unnamed(ApiError::Unauthenticated(message.to_owned())));
            }
        };
        match rule.map(|rule| rule.access) {
            Some(Access::Everyone) => Ok(caller),
            Some(Access::Only(roles)) if roles.contains(&caller.role) => Ok(caller),
            Some(Access::Only(roles)) => {
                let roles: Vec<&str> = roles.iter().map(|role| role.as_str()).collect();
                let (name, role) = (caller.name.clone(), caller.role.as_str());
                let message = format!(
                    "the token \"{name}\" has the role {role}, but the call requires one of: {}",
                    roles.join(", ")
                );
                Err((caller.name, ApiError::Denied(message)))
            }
            None => {
                let message = "this path does not exist, or no role may call it".to_owned();
                Err((caller.name, ApiError::Denied(message)))
            }
        }
    }
}

/// The token in the headers of a request.
fn bearer(headers: &HeaderMap) -> Result<Option<Secret>, ApiError> {
    let Some(value) = headers.get(header::AUTHORIZATION) else { return Ok(None) };
    let text = value.to_str().ok().and_then(|text| text.split_once(' '));
    match text {
        Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") && !token.trim().is_empty() => {
            Ok(Some(Secret::from_text(token.trim())))
        }
        _ => Err(ApiError::Unauthenticated("the header authorization must be `Bearer` and a token".to_owned())),
    }
}

/// The caller with this token, if the token is accepted now. All refusals are equal, so that they reveal nothing.
async fn find(store: &Store, secret: &Secret) -> Result<Caller, ApiError> {
    let record = store.token_by_hash(&secret.hash()).await?;
    let valid = record.filter(|record| record.is_valid(now_ms()));
    valid.map(|record| record.caller).ok_or_else(not_accepted)
}

/// Whether the headers are those of a gRPC request.
pub(super) fn is_grpc(headers: &HeaderMap) -> bool {
    headers.get(header::CONTENT_TYPE).is_some_and(|value| value.as_bytes().starts_with(b"application/grpc"))
}

/// The code of the answer as far as it is known when the answer starts.
fn code_of(response: &Response, is_grpc: bool) -> Code {
    if is_grpc {
        return response.headers().get("grpc-status").map_or(Code::Ok, |status| Code::from_bytes(status.as_bytes()));
    }
    match response.status().as_u16() {
        200..=399 => Code::Ok,
        401 => Code::Unauthenticated,
        403 => Code::PermissionDenied,
        _ => Code::Unknown,
    }
}
