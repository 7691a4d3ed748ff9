//! The part of Python's pickle that holds a tensor.
//!
//! A pickle is a program for a small stack machine. Two of its instructions fetch and call any Python function. This
//! reader knows only the instructions that a tensor needs, and the few names of functions and classes that `torch.save`
//! writes for a tensor. It calls no function, and refuses everything else. `pickletools.py` of CPython documents the
//! instructions.
//!
//! A pickle may store a value and recall it any number of times, also inside of itself. So values are shared and never
//! copied: the memory of the machine is in proportion to the instructions that ran, of which there is a limit.

use super::array::Kind;
use super::error::KernelFormatError;
use crate::shortened::shortened;
use std::collections::HashMap;
use std::rc::Rc;

/// A tensor as described by a pickle.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PickledTensor {
    /// Name of the file that holds the tensor's numbers.
    pub(super) storage: Rc<str>,
    pub(super) kind: Kind,
    /// Count of numbers in the storage.
    pub(super) numbers: usize,
    /// Index of the tensor's first number in the storage.
    pub(super) offset: usize,
    pub(super) shape: Vec<usize>,
    pub(super) stride: Vec<usize>,
}

/// Largest number of instructions, of values, and of tuples in each other. The pickle of a tensor has some fifty.
const INSTRUCTIONS_MAX: usize = 1000;
/// Largest pickle \[bytes\]. That of a tensor has some hundred.
const BYTES_MAX: usize = 64 << 10;

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Mark,
    None,
    Bool,
    Int(i64),
    Text(Rc<str>),
    Tuple(Rc<[Value]>),
    Dict,
    Known(Known),
    Storage(Rc<str>, Kind, usize),
    Tensor(Rc<PickledTensor>),
}

/// The names of functions and classes that are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    RebuildTensor,
    RebuildParameter,
    OrderedDict,
    Storage(Kind),
}

/// Reads the pickle of a single tensor or parameter.
pub(super) fn read(bytes: &[u8]) -> Result<PickledTensor, KernelFormatError> {
    if bytes.len() > BYTES_MAX {
        let message = format!("its pickle has {} bytes, but that of a tensor at most {BYTES_MAX}", bytes.len());
        return Err(KernelFormatError::Archive(message));
    }
    let mut machine = Machine { bytes, at: 0, stack: Vec::new(), memo: HashMap::new() };
    for _ in 0..INSTRUCTIONS_MAX {
        if machine.step()? {
            return match machine.stack.pop() {
                Some(Value::Tensor(tensor)) if machine.stack.is_empty() => Ok(tensor.as_ref().clone()),
                _ => Err(machine.refused("something other than one tensor")),
            };
        }
    }
    Err(machine.refused("too many instructions"))
}

struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    stack: Vec<Value>,
    memo: HashMap<usize, Value>,
}

impl Machine<'_> {
    /// Runs one instruction. Returns true at the end of the pickle.
    fn step(&mut self) -> Result<bool, KernelFormatError> {
        let start = self.at;
        let [instruction] = self.take()?;
        match instruction {
            0x80 => self.take::<1>().map(drop)?,
            0x95 => self.take::<8>().map(drop)?,
            b'.' => return Ok(true),
            b'(' => self.stack.push(Value::Mark),
            b'N' => self.stack.push(Value::None),
            0x88 | 0x89 => self.stack.push(Value::Bool),
            b')' => self.stack.push(Value::Tuple(Rc::new([]))),
            b'}' => self.stack.push(Value::Dict),
            b'K' => self.integer::<1>()?,
            b'M' => self.integer::<2>()?,
            b'J' => self.word()?,
            0x8a => self.long_integer(start)?,
            b'X' => {
                let length = u32::from_le_bytes(self.take()?);
                self.text(length as usize)?;
            }
            0x8c => {
                let [length] = self.take()?;
                self.text(length.into())?;
            }
            b't' => self.tuple_from_mark(start)?,
            0x85..=0x87 => self.tuple(instruction - 0x84, start)?,
            b'q' => self.keep::<1>()?,
            b'r' => self.keep::<4>()?,
            0x94 => {
                let top = self.top()?.clone();
                self.memo.insert(self.memo.len(), top);
            }
            b'h' => self.recall::<1>()?,
            b'j' => self.recall::<4>()?,
            b'c' => self.name_in_lines(start)?,
            0x93 => self.name_on_stack(start)?,
            b'Q' => self.reference(start)?,
            b'R' => self.call(start)?,
            other => return Err(self.refused_at(&format!("instruction 0x{other:02x}"), start)),
        }
        Ok(false)
    }

    /// Pushes a signed integer of four bytes.
    fn word(&mut self) -> Result<(), KernelFormatError> {
        let number = i32::from_le_bytes(self.take()?);
        self.stack.push(Value::Int(number.into()));
        Ok(())
    }

    /// Pushes an integer whose first byte gives its length.
    fn long_integer(&mut self, start: usize) -> Result<(), KernelFormatError> {
        let [length] = self.take()?;
        let bytes = self.slice(length.into())?;
        let number = bytes.iter().rev().fold(0_u64, |number, &byte| number << 8 | u64::from(byte));
        let number = i64::try_from(number).ok().filter(|_| length < 8);
        self.stack.push(Value::Int(number.ok_or_else(|| self.refused_at("a huge number", start))?));
        Ok(())
    }

    /// Replaces all values since the latest mark by a tuple of them.
    fn tuple_from_mark(&mut self, start: usize) -> Result<(), KernelFormatError> {
        let mark = self.stack.iter().rposition(|value| matches!(value, Value::Mark));
        let items = self.stack.split_off(mark.ok_or_else(|| self.refused_at("a tuple without a start", start))? + 1);
        self.stack.pop();
        self.stack.push(Value::Tuple(items.into()));
        Ok(())
    }

    /// Replaces the latest `items` values by a tuple of them.
    fn tuple(&mut self, items: u8, start: usize) -> Result<(), KernelFormatError> {
        let first = self.stack.len().checked_sub(items.into());
        let taken = self.stack.split_off(first.ok_or_else(|| self.refused_at("a tuple of too few values", start))?);
        self.stack.push(Value::Tuple(taken.into()));
        Ok(())
    }

    /// Pushes a name that is written in two lines: module and name.
    fn name_in_lines(&mut self, start: usize) -> Result<(), KernelFormatError> {
        let (module, name) = (self.line()?, self.line()?);
        let known = self.known(&module, &name, start)?;
        self.stack.push(known);
        Ok(())
    }

    /// Pushes a name whose two parts, module and name, are the latest values.
    fn name_on_stack(&mut self, start: usize) -> Result<(), KernelFormatError> {
        let (Some(Value::Text(name)), Some(Value::Text(module))) = (self.stack.pop(), self.stack.pop()) else {
            return Err(self.refused_at("a name that is not text", start));
        };
        let known = self.known(&module, &name, start)?;
        self.stack.push(known);
        Ok(())
    }

    /// Pushes a reference to a storage, which is a file of the archive.
    fn reference(&mut self, start: usize) -> Result<(), KernelFormatError> {
        let identity = self.stack.pop();
        let storage =
            storage(identity).ok_or_else(|| self.refused_at("a reference to something other than a storage", start))?;
        self.stack.push(storage);
        Ok(())
    }

    /// Replaces a function and its arguments by the result of the call, without calling the function.
    fn call(&mut self, start: usize) -> Result<(), KernelFormatError> {
        let (arguments, function) = (self.stack.pop(), self.stack.pop());
        let result = call_result(function, arguments).ok_or_else(|| self.refused_at("an unsupported call", start))?;
        self.stack.push(result);
        Ok(())
    }

    fn known(&self, module: &str, name: &str, at: usize) -> Result<Value, KernelFormatError> {
        let known = match (module, name) {
            ("torch._utils", "_rebuild_tensor_v2") => Known::RebuildTensor,
            ("torch._utils", "_rebuild_parameter") => Known::RebuildParameter,
            ("collections", "OrderedDict") => Known::OrderedDict,
            ("torch", "HalfStorage") => Known::Storage(Kind::F16),
            ("torch", "FloatStorage") => Known::Storage(Kind::F32),
            ("torch", "DoubleStorage") => Known::Storage(Kind::F64),
            ("torch", "ComplexFloatStorage") => Known::Storage(Kind::C64),
            ("torch", "ComplexDoubleStorage") => Known::Storage(Kind::C128),
            _ => return Err(self.refused_at(&format!("the name {}.{}", shortened(module), shortened(name)), at)),
        };
        Ok(Value::Known(known))
    }

    fn integer<const BYTES: usize>(&mut self) -> Result<(), KernelFormatError> {
        let number = self.take::<BYTES>()?.iter().rev().fold(0_i64, |number, &byte| number << 8 | i64::from(byte));
        self.stack.push(Value::Int(number));
        Ok(())
    }

    fn text(&mut self, length: usize) -> Result<(), KernelFormatError> {
        let text = String::from_utf8_lossy(self.slice(length)?).into_owned();
        self.stack.push(Value::Text(text.into()));
        Ok(())
    }

    fn keep<const BYTES: usize>(&mut self) -> Result<(), KernelFormatError> {
        let key = self.take::<BYTES>()?.iter().rev().fold(0_usize, |key, &byte| key << 8 | usize::from(byte));
        let top = self.top()?.clone();
        self.memo.insert(key, top);
        Ok(())
    }

    fn recall<const BYTES: usize>(&mut self) -> Result<(), KernelFormatError> {
        let key = self.take::<BYTES>()?.iter().rev().fold(0_usize, |key, &byte| key << 8 | usize::from(byte));
        let value =
            self.memo.get(&key).cloned().ok_or_else(|| self.refused("a reference to a value that was never stored"))?;
        self.stack.push(value);
        Ok(())
    }

    fn top(&self) -> Result<&Value, KernelFormatError> {
        self.stack.last().ok_or_else(|| self.refused("an empty stack"))
    }

    fn take<const BYTES: usize>(&mut self) -> Result<[u8; BYTES], KernelFormatError> {
        let chunk = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk()).copied();
        self.at += BYTES;
        chunk.ok_or_else(|| KernelFormatError::Archive("its pickle ends early".to_owned()))
    }

    fn slice(&mut self, length: usize) -> Result<&[u8], KernelFormatError> {
        let start = self.at;
        self.at = start.saturating_add(length);
        self.bytes.get(start..self.at).ok_or_else(|| KernelFormatError::Archive("its pickle ends early".to_owned()))
    }

    fn line(&mut self) -> Result<String, KernelFormatError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let end = rest.iter().position(|&byte| byte == b'\n');
        let end = end.ok_or_else(|| KernelFormatError::Archive("its pickle ends early".to_owned()))?;
        let line = String::from_utf8_lossy(&rest[..end]).into_owned();
        self.at += end + 1;
        Ok(line)
    }

    fn refused(&self, found: &str) -> KernelFormatError {
        self.refused_at(found, self.at)
    }

    fn refused_at(&self, found: &str, at: usize) -> KernelFormatError {
        KernelFormatError::Pickle { found: found.to_owned(), at }
    }
}

/// The storage that a reference `("storage", type, key, device, numbers)` describes.
fn storage(identity: Option<Value>) -> Option<Value> {
    let Some(Value::Tuple(parts)) = identity else { return None };
    let [Value::Text(tag), Value::Known(Known::Storage(kind)), Value::Text(key), Value::Text(_), Value::Int(numbers)] =
        &parts[..]
    else {
        return None;
    };
    // A key is a file name. It must not lead to another folder.
    let plain = !key.is_empty() && key.bytes().all(|byte| byte.is_ascii_alphanumeric());
    (&**tag == "storage" && plain).then(|| Some(Value::Storage(key.clone(), *kind, usize::try_from(*numbers).ok()?)))?
}

/// The result that a call of an accepted function would give. `None`: the call is not accepted.
fn call_result(function: Option<Value>, arguments: Option<Value>) -> Option<Value> {
    let (Some(Value::Known(function)), Some(Value::Tuple(arguments))) = (function, arguments) else { return None };
    match function {
        Known::OrderedDict if arguments.is_empty() => Some(Value::Dict),
        Known::RebuildParameter => match arguments.first() {
            Some(tensor @ Value::Tensor(_)) => Some(tensor.clone()),
            _ => None,
        },
        Known::RebuildTensor => {
            let [
                Value::Storage(storage, kind, numbers),
                Value::Int(offset),
                Value::Tuple(shape),
                Value::Tuple(stride),
                ..,
            ] = &arguments[..]
            else {
                return None;
            };
            let sizes = |values: &[Value]| -> Option<Vec<usize>> {
                let size =
                    |value: &Value| if let Value::Int(size) = value { usize::try_from(*size).ok() } else { None };
                values.iter().map(size).collect()
            };
            let (shape, stride) = (sizes(shape)?, sizes(stride)?);
            (shape.len() == stride.len() && shape.len() <= 8).then_some(())?;
            Some(Value::Tensor(Rc::new(PickledTensor {
                storage: storage.clone(),
                kind: *kind,
                numbers: *numbers,
                offset: usize::try_from(*offset).ok()?,
                shape,
                stride,
            })))
        }
        Known::OrderedDict | Known::Storage(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(pickle: &[u8]) -> String {
        read(pickle).unwrap_err().to_string()
    }

    #[test]
    fn code_is_refused_by_name_and_not_run() {
        for (pickle, sign) in [
            (&b"\x80\x02cos\nsystem\nX\x07\x00\x00\x00echo hi\x85R."[..], "the name os.system at byte 2"),
            (b"\x80\x02cposix\nsystem\nq\x00X\x02\x00\x00\x00id\x85q\x01Rq\x02.", "posix.system"),
            (b"\x80\x02c__builtin__\neval\nX\x01\x00\x00\x001\x85R.", "__builtin__.eval"),
            (b"\x80\x04\x8c\x08builtins\x8c\x04exec\x93X\x01\x00\x00\x001\x85R.", "builtins.exec"),
            (b"(S'id'\nios\nsystem\n.", "instruction 0x53"),
            (b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n(K\x01tR.", "an unsupported call"),
            (b"\x80\x02}.", "something other than one tensor"),
            (b"\x80\x02\x82\x01.", "instruction 0x82"),
        ] {
            let error = refusal(pickle);
            assert!(error.contains(sign), "{error}");
        }
        assert!(refusal(b"\x80\x02").contains("ends early"));
        assert!(refusal(&b"(".repeat(20_000)).contains("too many"));
    }

    /// A tuple of three times itself, again and again, would have 3³³⁰ parts if values were copied.
    #[test]
    fn values_that_hold_each_other_are_neither_copied_nor_followed() {
        let pickle = [&b"\x80\x02X\x04\x00\x00\x00boom"[..], &b"q\x00h\x00h\x00\x87".repeat(240), b"."].concat();
        assert!(refusal(&pickle).contains("something other than one tensor"));
        let nested = [&b"N"[..], &b"\x85".repeat(INSTRUCTIONS_MAX - 2), b"."].concat();
        assert!(refusal(&nested).contains("something other than one tensor"));
        assert!(refusal(&vec![b'N'; BYTES_MAX + 1]).contains("at most 65536"));
    }

    #[test]
    fn storage_keys_cannot_name_other_folders() {
        let identity = |key: &str| {
            let text = |text: &str| Value::Text(text.into());
            Some(Value::Tuple(Rc::new([
                text("storage"),
                Value::Known(Known::Storage(Kind::F32)),
                text(key),
                text("cpu"),
                Value::Int(4),
            ])))
        };
        assert!(storage(identity("0")).is_some());
        assert!(storage(identity("../../etc/passwd")).is_none());
    }
}
