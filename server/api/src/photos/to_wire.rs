//! Conversion of scores into messages.

use crate::optics::to_wire;
use lightpath_camera::photo_score::{AlignedPhoto, ChannelScore};
use lightpath_proto::v1;
use lightpath_service::PhotoScore;

/// Converts a score into its message.
pub(super) fn photo_score(score: PhotoScore) -> v1::PhotoScore {
    let PhotoScore { scored, region, aligned, error } = score;
    v1::PhotoScore {
        place: Some(place(&scored.aligned)),
        region: Some(to_wire::region_message(region)),
        channels: scored.channels.iter().map(channel).collect(),
        saturated: scored.saturated,
        aligned,
        error,
    }
}

fn place(aligned: &AlignedPhoto) -> v1::PhotoPlace {
    let [k1, k2, p1, p2] = aligned.found.map.distortion();
    v1::PhotoPlace {
        homography: aligned.found.map.homography().entries().to_vec(),
        k1,
        k2,
        p1,
        p2,
        mirrored: aligned.found.map.is_mirrored(),
        correlation: aligned.found.correlation,
        residual_rms_px: aligned.residual.map(|residual| residual.rms_px),
        residual_largest_px: aligned.residual.map(|residual| residual.largest_px),
        residual_blocks: aligned.residual.map_or(0, |residual| residual.blocks as u32),
    }
}

fn channel(score: &ChannelScore) -> v1::ChannelScore {
    v1::ChannelScore {
        psnr_db: score.psnr_db,
        psnr_with_offset_db: score.psnr_with_offset_db,
        gain: score.gain,
        ssim: score.ssim,
        speckle_contrast: score.speckle_contrast,
        resolution_cycles_per_px: score.resolution.cycles_per_px,
    }
}
