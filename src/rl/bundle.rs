//! Named tensors and a short description: how learners and policies are kept.
//!
//! The bytes are a safetensors file, so other tools can read the weights.
//! Equal bundles give equal bytes. Reading trusts nothing: a truncated file, a
//! name given twice, a number that is not finite, an unknown element type, a
//! missing or misshapen tensor are each a [`BundleError`] of their own.
//!
//! Architecture Invariant: no IO; bytes come in and go out.

use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};

/// What is wrong with the bytes or the contents of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BundleError {
    /// The bytes are no safetensors file, or are cut off.
    #[error("not a readable safetensors file: {why}")]
    Format {
        /// What the reader said.
        why: String,
    },
    /// Two tensors have one name.
    #[error("tensor `{name}` is given twice")]
    Duplicate {
        /// The name.
        name: String,
    },
    /// A NaN or an infinity.
    #[error("tensor `{name}` holds a number that is not finite at index {index}")]
    NotFinite {
        /// The tensor.
        name: String,
        /// Where in it, flat.
        index: usize,
    },
    /// A tensor that must be there is not.
    #[error("tensor `{name}` is missing")]
    Missing {
        /// The name looked for.
        name: String,
    },
    /// A tensor has another shape than the network or the counters need.
    #[error("tensor `{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        /// The tensor.
        name: String,
        /// What is needed.
        expected: Vec<usize>,
        /// What is there.
        found: Vec<usize>,
    },
    /// A tensor has another element type than needed.
    #[error("tensor `{name}` holds {found}, expected {expected}")]
    Type {
        /// The tensor.
        name: String,
        /// What is needed.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// The contents do not fit each other, the world, or the configuration.
    #[error("{what} is {found}, expected {expected}")]
    Mismatch {
        /// What was compared.
        what: &'static str,
        /// What is needed.
        expected: String,
        /// What is there.
        found: String,
    },
}

/// The numbers of a tensor.
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

/// A type of number that a tensor can hold.
pub trait Element: Copy {
    /// Its name in error messages.
    const NAME: &'static str;
    /// Wraps numbers of this type.
    fn wrap(values: Vec<Self>) -> Data;
    /// The numbers, if they are of this type.
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

/// Named tensors and a short description.
///
/// ```
/// use brakecheck::rl::Bundle;
///
/// let mut bundle = Bundle::new("(kind: \"example\")");
/// bundle.put("weights", &[2, 1], vec![0.5f32, -1.0]);
/// let bytes = bundle.to_bytes()?;
/// assert_eq!(Bundle::from_bytes(&bytes)?, bundle);
/// assert!(Bundle::from_bytes(&bytes[..bytes.len() - 1]).is_err());
/// # Ok::<(), brakecheck::rl::BundleError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Bundle {
    meta: String,
    tensors: BTreeMap<String, Tensor>,
}

impl Bundle {
    /// An empty bundle with this description.
    pub fn new(meta: impl Into<String>) -> Bundle {
        Bundle {
            meta: meta.into(),
            tensors: BTreeMap::new(),
        }
    }

    /// The description.
    pub fn meta(&self) -> &str {
        &self.meta
    }

    /// The names of the tensors, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.keys().map(String::as_str)
    }

    /// The shape of a tensor, if there is one of this name.
    pub fn shape(&self, name: &str) -> Option<&[usize]> {
        self.tensors.get(name).map(|tensor| tensor.shape.as_slice())
    }

    /// The same without a tensor.
    #[must_use]
    pub fn without(mut self, name: &str) -> Bundle {
        self.tensors.remove(name);
        self
    }

    /// Adds a tensor, or replaces the one of this name.
    pub fn put<T: Element>(&mut self, name: impl Into<String>, shape: &[usize], values: Vec<T>) {
        // Invariant: whoever writes a tensor knows its shape.
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

    /// The numbers of a tensor that must have this shape.
    ///
    /// # Errors
    /// When it is missing, or of another type or shape.
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

    /// The numbers of a tensor of rows: `[any, columns]`, or `[any]` for none.
    ///
    /// # Errors
    /// When it is missing, or of another type or shape.
    pub fn rows<T: Element>(&self, name: &str, columns: &[usize]) -> Result<&[T], BundleError> {
        let tensor = self.tensor(name)?;
        let rows = tensor.shape.first().copied().unwrap_or(0);
        let shape: Vec<usize> = std::iter::once(rows)
            .chain(columns.iter().copied())
            .collect();
        self.get(name, &shape)
    }

    /// One number, kept with shape `[1]`.
    ///
    /// # Errors
    /// When it is missing, or of another type or shape.
    pub fn one<T: Element>(&self, name: &str) -> Result<T, BundleError> {
        Ok(self.get(name, &[1])?[0])
    }

    /// The bytes of a safetensors file; equal bundles give equal bytes.
    ///
    /// # Errors
    /// When the names alone exceed what the format allows (100 MB).
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
        let meta = HashMap::from([("meta".to_string(), self.meta.clone())]);
        safetensors::serialize(views, Some(meta)).map_err(format)
    }

    /// Reads what [`Bundle::to_bytes`] wrote.
    ///
    /// # Errors
    /// See [`BundleError`]; every byte string either is a bundle of finite
    /// numbers or is refused.
    pub fn from_bytes(bytes: &[u8]) -> Result<Bundle, BundleError> {
        let file = SafeTensors::deserialize(bytes).map_err(format)?;
        let (header, metadata) = SafeTensors::read_metadata(bytes).map_err(format)?;
        refuse_duplicates(bytes.get(8..8 + header).unwrap_or(&[]))?;
        let meta = metadata.metadata().as_ref().and_then(|map| map.get("meta"));
        let mut bundle = Bundle::new(meta.cloned().unwrap_or_default());
        for (name, view) in file.iter() {
            let data = decode(name, &view)?;
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
        Data::F32(v) => (Dtype::F32, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        Data::F64(v) => (Dtype::F64, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        Data::U8(v) => (Dtype::U8, v.clone()),
        Data::U32(v) => (Dtype::U32, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        Data::U64(v) => (Dtype::U64, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
    }
}

fn decode(name: &str, view: &TensorView) -> Result<Data, BundleError> {
    let bytes = view.data();
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

/// The safetensors crate keeps the last of two equal names; here it is an error.
fn refuse_duplicates(header: &[u8]) -> Result<(), BundleError> {
    let Names(mut names) = serde_json::from_slice(header).map_err(|error| BundleError::Format {
        why: error.to_string(),
    })?;
    names.sort();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(BundleError::Duplicate {
            name: pair[0].clone(),
        }),
        None => Ok(()),
    }
}

/// The keys of a map, duplicates included.
struct Names(Vec<String>);

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Names, D::Error> {
        struct Keys;
        impl<'de> Visitor<'de> for Keys {
            type Value = Names;
            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a map")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Names, A::Error> {
                let mut names = Vec::new();
                while let Some((name, IgnoredAny)) = map.next_entry()? {
                    names.push(name);
                }
                Ok(Names(names))
            }
        }
        deserializer.deserialize_map(Keys)
    }
}
