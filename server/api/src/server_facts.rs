//! The server service: facts about the server and about the caller's token.

use crate::api::Api;
use crate::call::answers;
use crate::time::timestamp;
use lightpath_proto::v1;
use lightpath_proto::v1::server_service_server::ServerService;
use lightpath_service::{Call, Result};

answers! {
    ServerService {
        get_server(v1::GetServerRequest) -> v1::Server;
    }
}

impl Api {
    /// Returns facts about the server and the caller.
    pub(crate) async fn get_server(&self, call: &Call, _: v1::GetServerRequest) -> Result<v1::Server> {
        let space = self.artifacts.space();
        Ok(v1::Server {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            time: Some(timestamp(self.store.now_ms())),
            token: call.caller.name.clone(),
            role: call.caller.role.as_str().to_owned(),
            displays: call.caller.displays.iter().map(|id| format!("displays/{id}")).collect(),
            disk_free_bytes: space.free_bytes()?,
            disk_reserve_bytes: space.limits().reserve_bytes,
        })
    }
}
