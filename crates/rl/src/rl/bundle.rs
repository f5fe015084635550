//! Named tensors with a short description, the format of learners and policies.
//!
//! The bytes are a safetensors file, so other tools can read the weights. Equal
//! bundles give equal bytes. The reader trusts no input. Each
//! defect has a [`BundleError`] of its own: a truncated file, a repeated name, a
//! number that is not finite, an unknown element type, a missing or misshapen
//! tensor.
//!
//! Architecture Invariant: no IO. Bytes come in and go out.

use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};

/// Error in the bytes or the contents of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BundleError {
    /// The bytes are not a safetensors file, or are truncated.
    #[error("not a readable safetensors file: {why}")]
    Format {
        /// Message of the reader.
        why: String,
    },
    /// Two tensors have the same name.
    #[error("tensor `{name}` is given twice")]
    Duplicate {
        /// Repeated name.
        name: String,
    },
    /// A tensor contains a NaN or an infinity.
    #[error("tensor `{name}` holds a number that is not finite at index {index}")]
    NotFinite {
        /// Name of the tensor.
        name: String,
        /// Flat index of the number.
        index: usize,
    },
    /// A required tensor is missing.
    #[error("tensor `{name}` is missing")]
    Missing {
        /// Name of the missing tensor.
        name: String,
    },
    /// A tensor has another shape than the network or the counters require.
    #[error("tensor `{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        /// Name of the tensor.
        name: String,
        /// Required shape.
        expected: Vec<usize>,
        /// Shape in the bundle.
        found: Vec<usize>,
    },
    /// A tensor has another element type than required.
    #[error("tensor `{name}` holds {found}, expected {expected}")]
    Type {
        /// Name of the tensor.
        name: String,
        /// Required element type.
        expected: &'static str,
        /// Element type in the bundle.
        found: String,
    },
    /// The contents do not fit each other, the world, or the configuration.
    #[error("{what} is {found}, expected {expected}")]
    Mismatch {
        /// Compared quantity.
        what: &'static str,
        /// Required value.
        expected: String,
        /// Value in the bundle.
        found: String,
    },
}

/// Numbers of a tensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 64-bit floats.
    F64(Vec<f64>),
    /// Bytes.
    U8(Vec<u8>),
    /// 32-bit counters.
    U32(Vec<u32>),
    /// 64-bit counters.
    U64(Vec<u64>),
}

/// Number type that a tensor can contain.
pub trait Element: Copy {
    /// Name of the type in error messages.
    const NAME: &'static str;
    /// Wraps numbers of this type.
    fn wrap(values: Vec<Self>) -> Data;
    /// Returns the numbers if they are of this type.
    fn view(data: &Data) -> Option<&[Self]>;
}

macro_rules! element {
    ($($number:ty, $variant:ident;)*) => {$(
        impl Element for $number {
            const NAME: &'static str = stringify!($number);
            fn wrap(values: Vec<Self>) -> Data {
                Data::$variant(values)
            }
            fn view(data: &Data) -> Option<&[Self]> {
                match data {
                    Data::$variant(values) => Some(values),
                    _ => None,
                }
            }
        }
    )*};
}

element! { f32, F32; f64, F64; u8, U8; u32, U32; u64, U64; }

#[derive(Clone, Debug, PartialEq)]
struct Tensor {
    shape: Vec<usize>,
    data: Data,
}

/// Named tensors with a short description.
///
/// ```
/// # use brakecheck_rl as brakecheck;
/// use brakecheck::rl::TensorFile;
///
/// let mut bundle = TensorFile::new("(kind: \"example\")");
/// bundle.put("weights", &[2, 1], vec![0.5f32, -1.0]);
/// let bytes = bundle.to_bytes()?;
/// assert_eq!(TensorFile::from_bytes(&bytes)?, bundle);
/// assert!(TensorFile::from_bytes(&bytes[..bytes.len() - 1]).is_err());
/// # Ok::<(), brakecheck::rl::BundleError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TensorFile {
    meta: String,
    tensors: BTreeMap<String, Tensor>,
}

impl TensorFile {
    /// Creates an empty bundle with this description.
    pub fn new(meta: impl Into<String>) -> TensorFile {
        TensorFile {
            meta: meta.into(),
            tensors: BTreeMap::new(),
        }
    }

    /// Returns the description.
    pub fn meta(&self) -> &str {
        &self.meta
    }

    /// Returns the names of the tensors, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.keys().map(String::as_str)
    }

    /// Returns the shape of a tensor, if it exists.
    pub fn shape(&self, name: &str) -> Option<&[usize]> {
        self.tensors.get(name).map(|tensor| tensor.shape.as_slice())
    }

    /// Returns the bundle without a tensor.
    #[must_use]
    pub fn without(mut self, name: &str) -> TensorFile {
        self.tensors.remove(name);
        self
    }

    /// Adds a tensor, or replaces the tensor of this name.
    ///
    /// Panics if `shape` does not fit the number of values.
    pub fn put<T: Element>(&mut self, name: impl Into<String>, shape: &[usize], values: Vec<T>) {
        // Invariant: the caller knows the shape of the tensor it writes.
        assert_eq!(
            shape.iter().product::<usize>(),
            values.len(),
            "shape of a tensor"
        );
        self.tensors.insert(
            name.into(),
            Tensor {
                shape: shape.to_vec(),
                data: T::wrap(values),
            },
        );
    }

    /// Returns the numbers of a tensor that must have this shape.
    ///
    /// # Errors
    /// The tensor is missing, or has another type or shape.
    pub fn get<T: Element>(&self, name: &str, shape: &[usize]) -> Result<&[T], BundleError> {
        let tensor = self.tensor(name)?;
        if tensor.shape != shape {
            return Err(BundleError::Shape {
                name: name.into(),
                expected: shape.to_vec(),
                found: tensor.shape.clone(),
            });
        }
        typed(name, tensor)
    }

    /// Returns the numbers of a tensor of rows, shape `[any, columns]`.
    ///
    /// With empty `columns` the shape is `[any]`.
    ///
    /// # Errors
    /// The tensor is missing, or has another type or shape.
    pub fn rows<T: Element>(&self, name: &str, columns: &[usize]) -> Result<&[T], BundleError> {
        let tensor = self.tensor(name)?;
        // The number of rows is taken from the file, and `get` then checks the rest.
        let rows = tensor.shape.first().copied().unwrap_or(0);
        let shape: Vec<usize> = std::iter::once(rows)
            .chain(columns.iter().copied())
            .collect();
        self.get(name, &shape)
    }

    /// Returns a single number, stored with shape `[1]`.
    ///
    /// # Errors
    /// The tensor is missing, or has another type or shape.
    pub fn one<T: Element>(&self, name: &str) -> Result<T, BundleError> {
        Ok(self.get(name, &[1])?[0])
    }

    /// Returns the bytes of a safetensors file, equal for equal bundles.
    ///
    /// # Errors
    /// The names alone exceed the limit of the format (100 MB).
    pub fn to_bytes(&self) -> Result<Vec<u8>, BundleError> {
        let bytes: Vec<(Dtype, Vec<u8>)> = self
            .tensors
            .values()
            .map(|tensor| encode(&tensor.data))
            .collect();
        let mut views = Vec::with_capacity(bytes.len());
        for ((name, tensor), (dtype, bytes)) in self.tensors.iter().zip(&bytes) {
            let view = TensorView::new(*dtype, tensor.shape.clone(), bytes).map_err(format)?;
            views.push((name.as_str(), view));
        }
        // A single entry, so the random order of a `HashMap` cannot reach the bytes.
        let meta = HashMap::from([("meta".to_string(), self.meta.clone())]);
        // Tensors are in the order of their names, which the map keeps.
        safetensors::serialize(views, Some(meta)).map_err(format)
    }

    /// Reads the bytes of [`TensorFile::to_bytes`].
    ///
    /// # Errors
    /// See [`BundleError`]. Every byte string is either a bundle of finite numbers
    /// or refused.
    pub fn from_bytes(bytes: &[u8]) -> Result<TensorFile, BundleError> {
        let file = SafeTensors::deserialize(bytes).map_err(format)?;
        let (header, metadata) = SafeTensors::read_metadata(bytes).map_err(format)?;
        // The first 8 bytes are the length of the header, which follows.
        refuse_duplicates(bytes.get(8..8 + header).unwrap_or(&[]))?;
        let meta = metadata.metadata().as_ref().and_then(|map| map.get("meta"));
        let mut bundle = TensorFile::new(meta.cloned().unwrap_or_default());
        for (name, view) in file.iter() {
            let data = decode(name, &view)?;
            // One NaN would spread to all weights at the next update.
            refuse_infinite(name, &data)?;
            let tensor = Tensor {
                shape: view.shape().to_vec(),
                data,
            };
            bundle.tensors.insert(name.to_string(), tensor);
        }
        Ok(bundle)
    }

    fn tensor(&self, name: &str) -> Result<&Tensor, BundleError> {
        self.tensors
            .get(name)
            .ok_or_else(|| BundleError::Missing { name: name.into() })
    }
}

fn typed<'a, T: Element>(name: &str, tensor: &'a Tensor) -> Result<&'a [T], BundleError> {
    T::view(&tensor.data).ok_or_else(|| BundleError::Type {
        name: name.into(),
        expected: T::NAME,
        // Only this error path encodes, for the name of the element type.
        found: encode(&tensor.data).0.to_string().to_lowercase(),
    })
}

fn format(error: safetensors::SafeTensorError) -> BundleError {
    BundleError::Format {
        why: error.to_string(),
    }
}

fn encode(data: &Data) -> (Dtype, Vec<u8>) {
    match data {
        // Little endian, which the format demands on every machine.
        Data::F32(v) => (Dtype::F32, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        Data::F64(v) => (Dtype::F64, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        Data::U8(v) => (Dtype::U8, v.clone()),
        Data::U32(v) => (Dtype::U32, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        Data::U64(v) => (Dtype::U64, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
    }
}

fn decode(name: &str, view: &TensorView) -> Result<Data, BundleError> {
    let bytes = view.data();
    // safetensors has checked the lengths against the shapes: no rest is left over.
    let four = bytes.as_chunks::<4>().0;
    let eight = bytes.as_chunks::<8>().0;
    Ok(match view.dtype() {
        Dtype::F32 => Data::F32(four.iter().map(|b| f32::from_le_bytes(*b)).collect()),
        Dtype::F64 => Data::F64(eight.iter().map(|b| f64::from_le_bytes(*b)).collect()),
        Dtype::U8 => Data::U8(bytes.to_vec()),
        Dtype::U32 => Data::U32(four.iter().map(|b| u32::from_le_bytes(*b)).collect()),
        Dtype::U64 => Data::U64(eight.iter().map(|b| u64::from_le_bytes(*b)).collect()),
        other => {
            return Err(BundleError::Type {
                name: name.into(),
                expected: "f32, f64, u8, u32 or u64",
                found: other.to_string().to_lowercase(),
            });
        }
    })
}

fn refuse_infinite(name: &str, data: &Data) -> Result<(), BundleError> {
    let index = match data {
        Data::F32(values) => values.iter().position(|x| !x.is_finite()),
        Data::F64(values) => values.iter().position(|x| !x.is_finite()),
        Data::U8(_) | Data::U32(_) | Data::U64(_) => None,
    };
    match index {
        Some(index) => Err(BundleError::NotFinite {
            name: name.into(),
            index,
        }),
        None => Ok(()),
    }
}

/// Refuses repeated names, of which the safetensors crate keeps the last.
fn refuse_duplicates(header: &[u8]) -> Result<(), BundleError> {
    let MapKeys(mut names) =
        serde_json::from_slice(header).map_err(|error| BundleError::Format {
            why: error.to_string(),
        })?;
    // Sorted, so that repeated names are neighbours.
    names.sort();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(BundleError::Duplicate {
            name: pair[0].clone(),
        }),
        None => Ok(()),
    }
}

/// Keys of a map, with repeated keys.
struct MapKeys(Vec<String>);

impl<'de> Deserialize<'de> for MapKeys {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<MapKeys, D::Error> {
        struct Keys;
        impl<'de> Visitor<'de> for Keys {
            type Value = MapKeys;
            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a map")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<MapKeys, A::Error> {
                let mut names = Vec::new();
                while let Some((name, IgnoredAny)) = map.next_entry()? {
                    names.push(name);
                }
                Ok(MapKeys(names))
            }
        }
        deserializer.deserialize_map(Keys)
    }
}
