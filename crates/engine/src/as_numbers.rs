//! Vectors, matrices and rotations, stored as numbers: `#[serde(with = "crate::as_numbers")]`.
//!
//! nalgebra stores its matrices only together with products that multiply and add at once where the processor can, by which bits
//! differ from machine to machine.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix4, Point3, Quaternion, Translation3, Unit, UnitQuaternion, UnitVector3, Vector3,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

/// Types that can be written as numbers, and made from the same numbers again to the last bit.
pub trait Numbers: Sized {
    /// Its numbers.
    fn numbers(&self) -> Vec<f64>;

    /// The value with these numbers; `None` if there is none.
    fn of(numbers: &[f64]) -> Option<Self>;
}

/// For serde.
pub fn serialize<T: Numbers, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    value.numbers().serialize(serializer)
}

/// For serde.
pub fn deserialize<'de, T: Numbers, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    let numbers = Vec::<f64>::deserialize(deserializer)?;
    T::of(&numbers).ok_or_else(|| D::Error::custom("the numbers are of something else"))
}

impl Numbers for Point3<f64> {
    fn numbers(&self) -> Vec<f64> {
        self.coords.as_slice().to_vec()
    }

    fn of(numbers: &[f64]) -> Option<Self> {
        let [x, y, z] = *numbers else { return None };
        Some(Self::new(x, y, z))
    }
}

impl Numbers for UnitVector3<f64> {
    fn numbers(&self) -> Vec<f64> {
        self.as_slice().to_vec()
    }

    fn of(numbers: &[f64]) -> Option<Self> {
        let [x, y, z] = *numbers else { return None };
        // It was one, to the last bit.
        Some(Unit::new_unchecked(Vector3::new(x, y, z)))
    }
}

impl Numbers for Isometry3<f64> {
    fn numbers(&self) -> Vec<f64> {
        let (translation, rotation) = (&self.translation.vector, &self.rotation.coords);
        translation.iter().chain(rotation.iter()).copied().collect()
    }

    fn of(numbers: &[f64]) -> Option<Self> {
        let [x, y, z, i, j, k, w] = *numbers else { return None };
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        Some(Self::from_parts(Translation3::new(x, y, z), rotation))
    }
}

impl Numbers for DVector<f64> {
    fn numbers(&self) -> Vec<f64> {
        self.as_slice().to_vec()
    }

    fn of(numbers: &[f64]) -> Option<Self> {
        Some(Self::from_column_slice(numbers))
    }
}

/// A square one: everything that is stored is.
impl Numbers for DMatrix<f64> {
    fn numbers(&self) -> Vec<f64> {
        self.as_slice().to_vec()
    }

    fn of(numbers: &[f64]) -> Option<Self> {
        let m = numbers.len().isqrt();
        (m * m == numbers.len()).then(|| Self::from_column_slice(m, m, numbers))
    }
}

impl Numbers for Vec<Point3<f64>> {
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(Numbers::numbers).collect()
    }

    fn of(numbers: &[f64]) -> Option<Self> {
        let (points, rest) = numbers.as_chunks::<3>();
        rest.is_empty().then(|| points.iter().map(|[x, y, z]| Point3::new(*x, *y, *z)).collect())
    }
}

/// Each after a one; a zero in place of those that there are not.
impl Numbers for Vec<Option<Matrix4<f64>>> {
    fn numbers(&self) -> Vec<f64> {
        let of = |matrix: &Option<Matrix4<f64>>| match matrix {
            Some(matrix) => std::iter::once(1.0).chain(matrix.iter().copied()).collect(),
            None => vec![0.0],
        };
        self.iter().flat_map(of).collect()
    }

    fn of(mut numbers: &[f64]) -> Option<Self> {
        let mut all = Vec::new();
        while let [first, rest @ ..] = numbers {
            if *first == 0.0 {
                (numbers, _) = (rest, all.push(None));
            } else {
                let (matrix, rest) = rest.split_at_checked(16)?;
                (numbers, _) = (rest, all.push(Some(Matrix4::from_column_slice(matrix))));
            }
        }
        Some(all)
    }
}
