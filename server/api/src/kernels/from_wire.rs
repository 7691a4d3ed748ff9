//! The kernels' enumerations from messages.

use crate::error::ApiError;
use crate::field::Field;
use lightpath_domain::kernel::KernelModel;
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_proto::v1;

pub(crate) fn model(field: &Field, value: i32) -> Result<KernelModel, ApiError> {
    field.known(value, |value| match v1::KernelModel::try_from(value).ok()? {
        v1::KernelModel::Unspecified | v1::KernelModel::Display => Some(KernelModel::Display),
        v1::KernelModel::Paper => Some(KernelModel::Paper),
        v1::KernelModel::Dense => Some(KernelModel::Dense),
        v1::KernelModel::Smooth => Some(KernelModel::Smooth),
        v1::KernelModel::Varying => Some(KernelModel::Varying),
    })
}

pub(crate) fn kernel_format(field: &Field, value: i32) -> Result<KernelFormat, ApiError> {
    field.known(value, |value| match v1::KernelFormat::try_from(value).ok()? {
        v1::KernelFormat::Unspecified | v1::KernelFormat::Safetensors => Some(KernelFormat::Safetensors),
        v1::KernelFormat::Compact => Some(KernelFormat::Compact),
        v1::KernelFormat::Pt => Some(KernelFormat::Pt),
        v1::KernelFormat::Npy => Some(KernelFormat::Npy),
        v1::KernelFormat::Npz => Some(KernelFormat::Npz),
        v1::KernelFormat::Complex64 => Some(KernelFormat::Complex64),
        v1::KernelFormat::F16 => Some(KernelFormat::F16),
    })
}
