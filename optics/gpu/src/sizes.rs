//! The layout of a problem's fields on a card, from its size and the card's limits.

use crate::plan::Plan;
use crate::shaders::layout::Layout;
use crate::shaders::transform::Transform;

/// Columns that a workgroup transforms side by side. Four neighbouring values fill a sector of memory.
const COLUMNS: [usize; 3] = [4, 2, 1];
/// Bytes of shared memory for the sums of each thread.
const SUM_BYTES: usize = 16;

/// Limits of a card's workgroups.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Workgroups {
    pub(crate) threads_max: usize,
    pub(crate) shared_bytes_max: usize,
}

impl From<&wgpu::Limits> for Workgroups {
    fn from(limits: &wgpu::Limits) -> Self {
        let threads = limits.max_compute_invocations_per_workgroup.min(limits.max_compute_workgroup_size_x);
        Self { threads_max: threads as usize, shared_bytes_max: limits.max_compute_workgroup_storage_size as usize }
    }
}

/// The layout of a problem; `None` if a side has a factor above 13, or is too long for the card's workgroups.
pub(crate) fn layout(height_px: usize, width_px: usize, limits: Workgroups) -> Option<Layout> {
    let rows = Plan::choose(width_px, limits.threads_max)?;
    let rows = [false, true]
        .map(|split| Transform { plan: rows.clone(), columns: 1, split })
        .into_iter()
        .find(|rows| rows.shared_bytes() + SUM_BYTES * rows.workgroup() <= limits.shared_bytes_max)?;
    let columns =
        COLUMNS.into_iter().filter(|&columns| (2 * width_px).is_multiple_of(columns)).find_map(|columns| {
            let plan = Plan::choose(height_px, limits.threads_max / columns)?;
            [false, true]
                .map(|split| Transform { plan: plan.clone(), columns, split })
                .into_iter()
                .find(|transform| transform.shared_bytes() <= limits.shared_bytes_max)
        })?;
    Some(Layout { height_px, width_px, rows, columns })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_keep_to_the_limits_of_workgroups() {
        for (shared_bytes_max, threads_max) in [(16 << 10, 256), (32 << 10, 1024), (48 << 10, 1024)] {
            let limits = Workgroups { threads_max, shared_bytes_max };
            for (height_px, width_px) in [(7, 11), (360, 640), (1080, 1920), (2160, 3840)] {
                // The smallest limits that Vulkan allows hold 4K's rows in no way.
                let Some(layout) = layout(height_px, width_px, limits) else {
                    assert_eq!((width_px, shared_bytes_max), (3840, 16 << 10));
                    continue;
                };
                assert!(layout.rows.workgroup() <= threads_max && layout.columns.workgroup() <= threads_max);
                let shared = layout.rows.shared_bytes().max(layout.columns.shared_bytes());
                assert!(shared <= shared_bytes_max, "{height_px} {width_px} {limits:?}: {shared}");
            }
        }
        let limits = Workgroups { threads_max: 1024, shared_bytes_max: 32 << 10 };
        assert!(layout(17, 64, limits).is_none() && layout(64, 34, limits).is_none());
    }
}
