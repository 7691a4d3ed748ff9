//! Streams that follow the changes of a kernel.

use super::to_wire;
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::call::Answers;
use crate::names;
use crate::watch::{self, Watch};
use lightpath_domain::kernel::{Kernel, KernelKey};
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result};
use lightpath_store::Store;

impl Api {
    pub(crate) async fn watch_kernel(
        &self,
        call: &Call,
        request: v1::WatchKernelRequest,
    ) -> Result<Answers<v1::Kernel>> {
        let key = names::kernel_key(call, &Field::new("name"), &request.name)?;
        let open = self.streams.open(StreamKind::Watch, &call.client)?;
        // The stream subscribes before the first read, so that it misses no change.
        let changes = self.store.subscribe_kernel_changes();
        let first = self.store.kernel(&key).await?;
        let source = KernelSource { store: self.store.clone(), key };
        Ok(watch::stream(source, first, changes, self.stopping.clone(), open))
    }
}

/// The kernel that a stream follows.
struct KernelSource {
    store: Store,
    key: KernelKey,
}

impl Watch for KernelSource {
    type Item = Kernel;
    type Change = KernelKey;
    type Message = v1::Kernel;

    async fn read(&self) -> Result<Kernel> {
        Ok(self.store.kernel(&self.key).await?)
    }

    fn concerns(&self, change: &KernelKey) -> bool {
        *change == self.key
    }

    fn is_last(&self, _: &Kernel) -> bool {
        false
    }

    fn message(&self, kernel: &Kernel) -> v1::Kernel {
        to_wire::kernel(kernel)
    }
}
