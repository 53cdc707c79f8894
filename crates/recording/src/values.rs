//! Values of components in rows that wait.

use std::sync::Arc;

use super::rerun::{
    AsComponents, ComponentDescriptor, SerializedComponentBatch,
    arrow::{
        array::{
            Array, ArrayRef, BooleanArray, FixedSizeListArray, Float32Array, Float64Array, ListArray, UInt8Array,
            UInt32Array,
        },
        buffer::OffsetBuffer,
        compute::concat,
        datatypes::{DataType, Field},
        error::ArrowError,
    },
};

/// A row's values of a component.
pub(super) type Cell = (ComponentDescriptor, Values);

/// Values of a component. Numbers stand one after the other: an array for each row would cost ten times its content.
#[derive(Clone, PartialEq)]
pub(super) enum Values {
    Singles(Vec<f32>),
    /// Points and half-sizes of a plane.
    Pairs(Vec<[f32; 2]>),
    /// Points and vectors.
    Triples(Vec<[f32; 3]>),
    /// Quaternions.
    Quads(Vec<[f32; 4]>),
    Doubles(Vec<f64>),
    Bytes(Vec<u8>),
    /// Counts, and colours as Rerun writes them.
    Words(Vec<u32>),
    Flags(Vec<bool>),
    /// Values that are lists themselves, such as lines of points: the length of each, and all their contents.
    Lists(Vec<usize>, Box<Self>),
    /// All other values, an array for each row.
    Arrays(Vec<ArrayRef>),
}

/// Applies an expression to the vector of any values except lists and arrays, which come last.
macro_rules! each {
    ($values:expr, $all:ident => $what:expr, $($other:tt)*) => {
        match $values {
            Self::Singles($all) => $what,
            Self::Pairs($all) => $what,
            Self::Triples($all) => $what,
            Self::Quads($all) => $what,
            Self::Doubles($all) => $what,
            Self::Bytes($all) => $what,
            Self::Words($all) => $what,
            Self::Flags($all) => $what,
            $($other)*
        }
    };
}

impl Values {
    /// The number of values.
    pub(super) fn len(&self) -> usize {
        each!(self, all => all.len(),
            Self::Lists(lengths, _) => lengths.len(),
            Self::Arrays(all) => all.iter().map(|array| array.len()).sum(),
        )
    }

    /// The memory that they hold, bytes.
    pub(super) fn bytes(&self) -> usize {
        each!(self, all => size_of_val(all.as_slice()),
            Self::Lists(lengths, values) => size_of_val(lengths.as_slice()) + values.bytes(),
            Self::Arrays(all) => all.iter().map(|array| array.get_buffer_memory_size()).sum(),
        )
    }

    /// Appends values of the same kind.
    pub(super) fn extend(&mut self, more: Self) {
        match (self, more) {
            (Self::Singles(all), Self::Singles(more)) => all.extend(more),
            (Self::Pairs(all), Self::Pairs(more)) => all.extend(more),
            (Self::Triples(all), Self::Triples(more)) => all.extend(more),
            (Self::Quads(all), Self::Quads(more)) => all.extend(more),
            (Self::Doubles(all), Self::Doubles(more)) => all.extend(more),
            (Self::Bytes(all), Self::Bytes(more)) => all.extend(more),
            (Self::Words(all), Self::Words(more)) => all.extend(more),
            (Self::Flags(all), Self::Flags(more)) => all.extend(more),
            (Self::Lists(lengths, all), Self::Lists(more_lengths, more)) => {
                lengths.extend(more_lengths);
                all.extend(*more);
            }
            (Self::Arrays(all), Self::Arrays(more)) => all.extend(more),
            // A component is of one kind.
            _ => {}
        }
    }

    pub(super) fn clear(&mut self) {
        each!(self, all => all.clear(),
            Self::Lists(lengths, all) => {
                lengths.clear();
                all.clear();
            }
            Self::Arrays(all) => all.clear(),
        );
    }

    /// One array of all but the first cells, which hold `skipped` values.
    pub(super) fn array(&self, cells: usize, skipped: usize) -> Result<ArrayRef, ArrowError> {
        let fixed = |numbers: &[f32], width: i32| -> Result<ArrayRef, ArrowError> {
            let item = Arc::new(Field::new("item", DataType::Float32, false));
            let numbers = Arc::new(Float32Array::from(numbers.to_vec()));
            Ok(Arc::new(FixedSizeListArray::try_new(item, width, numbers, None)?))
        };
        Ok(match self {
            Self::Singles(all) => Arc::new(Float32Array::from(all[skipped..].to_vec())),
            Self::Pairs(all) => fixed(all[skipped..].as_flattened(), 2)?,
            Self::Triples(all) => fixed(all[skipped..].as_flattened(), 3)?,
            Self::Quads(all) => fixed(all[skipped..].as_flattened(), 4)?,
            Self::Doubles(all) => Arc::new(Float64Array::from(all[skipped..].to_vec())),
            Self::Bytes(all) => Arc::new(UInt8Array::from(all[skipped..].to_vec())),
            Self::Words(all) => Arc::new(UInt32Array::from(all[skipped..].to_vec())),
            Self::Flags(all) => Arc::new(BooleanArray::from(all[skipped..].to_vec())),
            Self::Lists(lengths, all) => {
                let (before, lengths) = lengths.split_at(skipped);
                let values = all.array(cells, before.iter().sum())?;
                let item = Arc::new(Field::new("item", values.data_type().clone(), false));
                let lengths = OffsetBuffer::from_lengths(lengths.iter().copied());
                Arc::new(ListArray::try_new(item, lengths, values, None)?)
            }
            Self::Arrays(all) => match &all[cells..] {
                [array] => array.clone(),
                all => concat(&all.iter().map(AsRef::as_ref).collect::<Vec<&dyn Array>>())?,
            },
        })
    }
}

impl From<SerializedComponentBatch> for Values {
    fn from(batch: SerializedComponentBatch) -> Self {
        Self::Arrays(vec![batch.array])
    }
}

/// The cells of archetypes.
pub(super) fn cells<'a>(what: impl IntoIterator<Item = &'a dyn AsComponents>) -> Vec<Cell> {
    let batches = what.into_iter().flat_map(|archetype| archetype.as_serialized_batches());
    batches.map(|batch| (batch.descriptor.clone(), batch.into())).collect()
}
