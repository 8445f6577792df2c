//! Arrays of NumPy's `.npz` archives.

use npyz::NpyFile;
use std::io::{Cursor, Read};

/// Bytes that one array may unpack to: a picture of 8192 x 8192 in doubles is larger than any that is drawn here.
const ARRAY_BYTES_MAX: u64 = 1 << 29;

/// An array, last index fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Extent along each axis.
    pub shape: Vec<u64>,
    /// Its numbers; truth values as 0 and 1.
    pub values: Vec<f32>,
}

/// Names of the arrays in the archive `bytes`.
///
/// # Errors
///
/// A sentence that says why it is none.
pub fn names(bytes: &[u8]) -> Result<Vec<String>, String> {
    let archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let names = archive.file_names();
    Ok(names
        .filter_map(|name| name.strip_suffix(".npy").map(str::to_owned))
        .collect())
}

/// The array called `name` in the archive `bytes`.
///
/// # Errors
///
/// A sentence that says what is wrong: no archive, no such array, numbers of a kind that is not read.
pub fn read(bytes: &[u8], name: &str) -> Result<Array, String> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let known = names(bytes)?.join(", ");
    let file = archive
        .by_name(&format!("{name}.npy"))
        .map_err(|_| format!("it holds no array `{name}`, only {known}"))?;
    // The archive's own word for the size is not believed.
    let mut unpacked = Vec::new();
    file.take(ARRAY_BYTES_MAX + 1)
        .read_to_end(&mut unpacked)
        .map_err(|e| format!("array `{name}` does not unpack: {e}"))?;
    if unpacked.len() as u64 > ARRAY_BYTES_MAX {
        return Err(format!(
            "array `{name}` is larger than {ARRAY_BYTES_MAX} bytes"
        ));
    }
    array(&unpacked).map_err(|problem| format!("array `{name}`: {problem}"))
}

/// The array in the `.npy` file `bytes`.
///
/// # Errors
///
/// A sentence that says what is wrong.
pub fn array(bytes: &[u8]) -> Result<Array, String> {
    let file = NpyFile::new(bytes).map_err(|e| e.to_string())?;
    let shape = file.shape().to_vec();
    if file.order() != npyz::Order::C {
        return Err("its columns come first; save it in C order".to_owned());
    }
    let count = shape.iter().try_fold(1u64, |n, &side| n.checked_mul(side));
    if count.is_none_or(|count| count > bytes.len() as u64) {
        return Err(format!(
            "{shape:?} is more than its {} bytes hold",
            bytes.len()
        ));
    }
    let values = floats(file)?;
    Ok(Array { shape, values })
}

fn floats(file: NpyFile<&[u8]>) -> Result<Vec<f32>, String> {
    fn all<T, R: Iterator<Item = std::io::Result<T>>>(
        data: R,
        number: impl Fn(T) -> f32,
    ) -> Result<Vec<f32>, String> {
        data.map(|value| value.map(&number).map_err(|e| e.to_string()))
            .collect()
    }
    let dtype = file.dtype().descr();
    let file = match file.try_data::<f32>() {
        Ok(data) => return all(data, |v| v),
        Err(file) => file,
    };
    let file = match file.try_data::<f64>() {
        Ok(data) => return all(data, |v| v as f32),
        Err(file) => file,
    };
    let file = match file.try_data::<half::f16>() {
        Ok(data) => return all(data, f32::from),
        Err(file) => file,
    };
    let file = match file.try_data::<u8>() {
        Ok(data) => return all(data, f32::from),
        Err(file) => file,
    };
    match file.try_data::<bool>() {
        Ok(data) => all(data, |v| f32::from(u8::from(v))),
        Err(_) => Err(format!(
            "its numbers are {dtype}; save them as float16, float32, float64, uint8 or bool"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_half_precision_are_read() {
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let text = "{'descr': '<f2', 'fortran_order': False, 'shape': (3,), }";
        bytes.extend(format!("{text:<117}\n").bytes());
        bytes.extend([0x00, 0x3c, 0x00, 0xc0, 0x00, 0x38]);
        let array = array(&bytes).expect("an array");
        assert_eq!((array.shape, array.values), (vec![3], vec![1.0, -2.0, 0.5]));
    }

    #[test]
    fn what_is_no_archive_and_what_claims_too_much_is_told() {
        assert!(read(b"not a zip", "single").is_err());
        let mut huge = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (4000000000, 4000000000), }";
        huge.extend(format!("{text:<117}\n").bytes());
        assert!(array(&huge).unwrap_err().contains("4000000000"));
    }
}
