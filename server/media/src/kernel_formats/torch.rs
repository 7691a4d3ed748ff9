//! `.pt` files of one tensor, as `torch.save` has written them since PyTorch 1.6.
//!
//! Such a file is a zip archive with a folder of any name. In it, `data.pkl` describes the tensor ([`super::pickle`]),
//! `data/0` holds its numbers, and `byteorder` and `version` give the byte order and the version. Older files, bare
//! pickles, are refused.

use super::archive::{self, Archive, Content};
use super::array::Array;
use super::error::KernelFormatError;
use super::pickle::{self, PickledTensor};
use crate::budget::Budget;
use crate::shortened::shortened;
use lightpath_optics::interrupt;

/// Numbers that are gathered between two looks at the interrupt.
const NUMBERS_AT_ONCE: usize = 1 << 16;

/// Reads the tensor from the files of a `.pt` archive.
pub(super) fn read<'b>(archive: &Archive<'b>, budget: &'b Budget) -> Result<Array<'b>, KernelFormatError> {
    let Some(pickle_name) = archive.names().find(|name| name.ends_with("/data.pkl")) else {
        return Err(KernelFormatError::Archive("it has no data.pkl, so it is not a .pt file of torch.save".to_owned()));
    };
    let folder = pickle_name.trim_end_matches("data.pkl");
    let content = |name: &str| archive.content(&format!("{folder}{name}"), budget);
    let is_little = |order: Content<'_>| *order == *b"little";
    if !content("byteorder")?.is_none_or(is_little) {
        return Err(KernelFormatError::Archive("its byte order is not little-endian".to_owned()));
    }
    let absent = |name: &str| KernelFormatError::Archive(format!("it has no {}", shortened(format!("{folder}{name}"))));
    let tensor = pickle::read(&content("data.pkl")?.ok_or_else(|| absent("data.pkl"))?)?;
    let storage = format!("data/{}", tensor.storage);
    gather(&tensor, &content(&storage)?.ok_or_else(|| absent(&storage))?, budget)
}

/// Reads the tensor's numbers in C order, for any strides.
fn gather<'b>(tensor: &PickledTensor, bytes: &[u8], budget: &'b Budget) -> Result<Array<'b>, KernelFormatError> {
    let size = tensor.kind.bytes();
    let beyond = || KernelFormatError::Array {
        name: "the tensor".to_owned(),
        actual: format!("of shape {:?} with strides {:?} from number {}", tensor.shape, tensor.stride, tensor.offset),
        expected: format!("inside its storage of {} bytes", bytes.len()),
    };
    let last =
        tensor.shape.iter().zip(&tensor.stride).try_fold(tensor.offset, |last, (&side, &stride)| {
            last.checked_add(side.checked_sub(1)?.checked_mul(stride)?)
        });
    let available = bytes.len() / size;
    let count = tensor.shape.iter().try_fold(1_usize, |product, &side| product.checked_mul(side));
    let (Some(last), Some(count)) = (last, count) else { return Err(beyond()) };
    // With strides of zero a tensor could claim more numbers than the storage has.
    if last >= available || count > available || tensor.numbers > available {
        return Err(beyond());
    }
    let mut contiguous = vec![1; tensor.shape.len()];
    for i in (0..contiguous.len().saturating_sub(1)).rev() {
        contiguous[i] = contiguous[i + 1] * tensor.shape[i + 1];
    }
    let relevant = |strides: &[usize]| -> Vec<usize> {
        strides.iter().zip(&tensor.shape).filter(|(_, side)| **side > 1).map(|(stride, _)| *stride).collect()
    };
    if relevant(&tensor.stride) == relevant(&contiguous) {
        return Array::new(
            "the tensor",
            tensor.shape.clone(),
            tensor.kind,
            &bytes[tensor.offset * size..][..count * size],
            budget,
        );
    }
    let _gathered = budget.hold((count * size) as u64)?;
    let mut gathered = Vec::with_capacity(count * size);
    for i in 0..count {
        if i % NUMBERS_AT_ONCE == 0 {
            interrupt::check();
        }
        let along = |axis: usize| i / contiguous[axis] % tensor.shape[axis] * tensor.stride[axis];
        let at = tensor.offset + (0..tensor.shape.len()).map(along).sum::<usize>();
        gathered.extend(&bytes[at * size..][..size]);
    }
    Array::new("the tensor", tensor.shape.clone(), tensor.kind, &gathered, budget)
}

/// Writes a float32 tensor in the form that `torch.load` reads.
pub(super) fn write(shape: &[usize], numbers: &[f32]) -> Result<Vec<u8>, KernelFormatError> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    archive::write(&[
        ("kernel/data.pkl", &pickled(shape, numbers.len())),
        ("kernel/byteorder", b"little"),
        ("kernel/data/0", &bytes),
        ("kernel/version", b"3\n"),
    ])
}

/// Writes the pickle, protocol 2, of a contiguous float32 tensor.
fn pickled(shape: &[usize], numbers: usize) -> Vec<u8> {
    let mut pickle = b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n((".to_vec();
    text(&mut pickle, "storage");
    pickle.extend(b"ctorch\nFloatStorage\n");
    text(&mut pickle, "0");
    text(&mut pickle, "cpu");
    integer(&mut pickle, numbers);
    // Instructions for the storage and an offset of 0 in it.
    pickle.extend(b"tQK\x00");
    let strides = (0..shape.len()).map(|i| shape[i + 1..].iter().product());
    for sizes in [shape.to_vec(), strides.collect()] {
        pickle.push(b'(');
        sizes.into_iter().for_each(|size| integer(&mut pickle, size));
        pickle.push(b't');
    }
    // Instructions for: no gradient, no hooks.
    pickle.extend(b"\x89ccollections\nOrderedDict\n)RtR.");
    pickle
}

fn text(pickle: &mut Vec<u8>, text: &str) {
    pickle.push(b'X');
    pickle.extend((text.len() as u32).to_le_bytes());
    pickle.extend(text.as_bytes());
}

fn integer(pickle: &mut Vec<u8>, number: usize) {
    pickle.push(b'J');
    pickle.extend((number as i32).to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::super::array::Kind;
    use super::*;

    #[test]
    fn written_tensor_is_read_back() {
        let numbers: Vec<f32> = (0..24).map(|n| n as f32 / 7.0).collect();
        let (file, budget) = (write(&[1, 2, 3, 4], &numbers).unwrap(), Budget::new(1000));
        let array = read(&Archive::open(&file).unwrap(), &budget).unwrap();
        assert_eq!((array.shape, array.numbers, array.complex), (vec![1, 2, 3, 4], numbers, false));
    }

    #[test]
    fn strides_are_followed_but_not_beyond_the_storage() {
        let bytes: Vec<u8> = (0..6).flat_map(|n| (n as f32).to_le_bytes()).collect();
        let budget = Budget::new(1000);
        let gather = |tensor: &PickledTensor| gather(tensor, &bytes, &budget);
        let mut tensor = PickledTensor {
            storage: "0".into(),
            kind: Kind::F32,
            numbers: 6,
            offset: 0,
            shape: vec![3, 2],
            stride: vec![1, 3],
        };
        assert_eq!(gather(&tensor).unwrap().numbers, [0.0, 3.0, 1.0, 4.0, 2.0, 5.0]);
        tensor.offset = 1;
        assert!(gather(&tensor).is_err());
        let huge = PickledTensor { offset: 0, shape: vec![1 << 40, 1 << 40], stride: vec![0, 0], ..tensor };
        assert!(gather(&huge).is_err());
    }
}
