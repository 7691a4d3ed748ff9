//! Passing gRPC requests to the methods that handle them, and their results to the client.
//!
//! Admission puts a [`Call`] into the extensions of each request. A request without one has not been admitted and is
//! refused.

use crate::api::Api;
use crate::status;
use futures::StreamExt as _;
use futures::stream::BoxStream;
use lightpath_service::{Call, Result, ServiceError};
use tonic::{Request, Response, Status};

/// Result of a method with a stream of answers.
pub(crate) type Answers<A> = BoxStream<'static, Result<A>>;

/// A stream of answers with errors as tonic expects them.
pub(crate) type StatusStream<A> = BoxStream<'static, Result<A, Status>>;

/// Implements the trait of a gRPC service by the methods of [`Api`] that have the same names: with one answer each, then
/// with a stream of answers each.
macro_rules! answers {
    (
        $service:ident { $($method:ident($request:ty) -> $answer:ty;)* }
        $(streams { $($stream_method:ident($stream_request:ty) -> $item:ty as $stream:ident;)* })?
    ) => {
        #[tonic::async_trait]
        impl $service for Api {
            $(
                async fn $method(
                    &self,
                    request: tonic::Request<$request>,
                ) -> Result<tonic::Response<$answer>, tonic::Status> {
                    self.answer(request, Self::$method).await
                }
            )*
            $($(
                type $stream = $crate::call::StatusStream<$item>;

                async fn $stream_method(
                    &self,
                    request: tonic::Request<$stream_request>,
                ) -> Result<tonic::Response<Self::$stream>, tonic::Status> {
                    self.answer_with_stream(request, Self::$stream_method).await
                }
            )*)?
        }
    };
}
pub(crate) use answers;

impl Api {
    /// Handles a request with one answer.
    ///
    /// # Errors
    ///
    /// The status of the [`ServiceError`] that `handle` returns; UNAUTHENTICATED if the request has no [`Call`].
    pub(crate) async fn answer<Q, A>(
        &self,
        mut request: Request<Q>,
        handle: impl AsyncFnOnce(&Self, &Call, Q) -> Result<A>,
    ) -> Result<Response<A>, Status> {
        let call = request.extensions_mut().remove::<Call>().ok_or_else(|| status::of(ServiceError::NoCaller))?;
        handle(self, &call, request.into_inner()).await.map(Response::new).map_err(status::of)
    }

    /// Handles a request with a stream of answers.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::answer`]. A later error ends the stream with its status.
    pub(crate) async fn answer_with_stream<Q, A: 'static>(
        &self,
        request: Request<Q>,
        handle: impl AsyncFnOnce(&Self, &Call, Q) -> Result<Answers<A>>,
    ) -> Result<Response<StatusStream<A>>, Status> {
        let answer = self.answer(request, handle).await?;
        Ok(answer.map(|answers| answers.map(|answer| answer.map_err(status::of)).boxed()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::tests::api_in;
    use crate::rules::METHODS;
    use axum::body::Body;
    use tonic::Code;
    use tonic::codegen::{Service as _, http};

    /// Calls every method with an empty message, and returns the codes of the answers.
    async fn codes(api: Api, call: Option<Call>) -> Vec<(&'static str, Code)> {
        let mut routes = api.routes().unwrap().0.into_axum_router();
        let mut codes = Vec::new();
        for (method, _) in METHODS {
            let request = http::Request::post(format!("/lightpath.v1.{method}"))
                .header("content-type", "application/grpc")
                // A gRPC message without compression and without bytes.
                .body(Body::from(vec![0_u8; 5]));
            let mut request = request.unwrap();
            call.clone().map(|call| request.extensions_mut().insert(call));
            let answer = routes.call(request).await.unwrap();
            let status = answer.headers().get("grpc-status");
            codes.push((*method, status.map_or(Code::Ok, |status| Code::from_bytes(status.as_bytes()))));
        }
        codes
    }

    #[tokio::test]
    async fn no_method_answers_a_call_without_a_caller() {
        let folder = tempfile::tempdir().unwrap();
        let api = api_in(folder.path()).await;
        for (method, code) in codes(api.clone(), None).await {
            assert_eq!(code, Code::Unauthenticated, "{method}");
        }
        for (method, code) in codes(api, Some(Call::without_token())).await {
            assert!(
                !matches!(code, Code::Unauthenticated | Code::Unimplemented | Code::Internal),
                "{method}: {code:?}"
            );
        }
    }
}
