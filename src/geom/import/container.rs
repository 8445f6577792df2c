//! The bytes of a glTF file: the chunks of a GLB, data URIs and files beside the glTF.

use super::error::ImportFault;
use super::part::read_bytes;
use base64::Engine;
use std::path::{Path, PathBuf};

const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// The two chunks of a GLB, or the whole of a `.gltf` as its JSON.
pub(super) struct Chunks<'a> {
    pub json: &'a [u8],
    pub binary: Option<&'a [u8]>,
}

/// What a URI in a glTF file leads to.
pub(super) enum Resource {
    /// The bytes of a data URI.
    Bytes(Vec<u8>),
    /// A file, relative to the glTF's folder.
    File(PathBuf),
}

/// Splits `bytes` by their magic, whatever the file is called.
pub(super) fn split(bytes: &[u8]) -> Result<Chunks<'_>, ImportFault> {
    if !bytes.starts_with(b"glTF") {
        return Ok(Chunks {
            json: bytes,
            binary: None,
        });
    }
    let header = |problem: String| ImportFault::malformed("GLB header", problem);
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(header(format!("the file ends after {} bytes", bytes.len())));
    };
    if version != 2 {
        return Err(header(format!("version {version} is not 2")));
    }
    let length = length as usize;
    if length < HEADER_BYTES || length > bytes.len() {
        return Err(header(format!(
            "it claims {length} bytes where the file has {}",
            bytes.len()
        )));
    }
    // What lies after the claimed length is no part of the GLB.
    let mut rest = &bytes[HEADER_BYTES..length];
    let (kind, json) = next_chunk(&mut rest)?;
    if &kind != b"JSON" || json.is_empty() {
        return Err(ImportFault::malformed(
            "GLB chunk 0",
            "the first chunk must be a JSON chunk that is not empty",
        ));
    }
    let mut binary = None;
    while !rest.is_empty() && binary.is_none() {
        let (kind, chunk) = next_chunk(&mut rest)?;
        if &kind == b"BIN\0" {
            binary = Some(chunk);
        }
    }
    Ok(Chunks { json, binary })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let word = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes(word.try_into().expect("four bytes")))
}

/// Takes one chunk off `rest`: its kind and its content.
fn next_chunk<'a>(rest: &mut &'a [u8]) -> Result<([u8; 4], &'a [u8]), ImportFault> {
    let broken = |problem: String| ImportFault::malformed("GLB chunk", problem);
    let (Some(length), Some(kind)) = (word(rest, 0), rest.get(4..8)) else {
        return Err(broken(format!(
            "a chunk header needs {CHUNK_HEADER_BYTES} bytes and {} are left",
            rest.len()
        )));
    };
    let kind = kind.try_into().expect("four bytes");
    let length = length as usize;
    if !length.is_multiple_of(4) {
        return Err(broken(format!("length {length} is not a multiple of 4")));
    }
    let left = rest.len() - CHUNK_HEADER_BYTES;
    if length > left {
        return Err(broken(format!(
            "it claims {length} bytes where {left} are left"
        )));
    }
    let (chunk, after) = rest[CHUNK_HEADER_BYTES..].split_at(length);
    *rest = after;
    Ok((kind, chunk))
}

/// Follows a URI of the glTF file `from`, without reading another file yet.
pub(super) fn resolve(uri: &str, from: &Path, place: &str) -> Result<Resource, ImportFault> {
    let bad = |problem: String| ImportFault::malformed(place, problem);
    if let Some(data) = uri.strip_prefix("data:") {
        let (media, content) = data
            .split_once(',')
            .ok_or_else(|| bad("the data URI has no comma".to_owned()))?;
        let mut fields = media.split(';').collect::<Vec<_>>();
        if fields.pop() != Some("base64") || fields.iter().skip(1).any(|field| field.is_empty()) {
            return Err(bad(format!(
                "the data URI starts `data:{}`, not `data:<type>;base64`",
                media.chars().take(60).collect::<String>()
            )));
        }
        return base64::engine::general_purpose::STANDARD
            .decode(content)
            .map(Resource::Bytes)
            .map_err(|error| bad(format!("the data URI is not base64: {error}")));
    }
    let name = percent_decoded(uri)
        .ok_or_else(|| bad(format!("`{uri}` is not a percent-encoded file name")))?;
    if name.is_empty() || name.contains("://") || Path::new(&name).is_absolute() {
        return Err(bad(format!(
            "`{name}` is not the relative path of a file beside the glTF"
        )));
    }
    Ok(Resource::File(
        from.parent().unwrap_or(Path::new("")).join(name),
    ))
}

/// The bytes a URI leads to, read now.
pub(super) fn fetch(uri: &str, from: &Path, place: &str) -> Result<Vec<u8>, ImportFault> {
    match resolve(uri, from, place)? {
        Resource::Bytes(bytes) => Ok(bytes),
        Resource::File(path) => read_bytes(&path),
    }
}

fn percent_decoded(uri: &str) -> Option<String> {
    let mut decoded = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        if first == b'%' {
            let digits = std::str::from_utf8(after.get(..2)?).ok()?;
            decoded.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &after[2..];
        } else {
            decoded.push(first);
            rest = after;
        }
    }
    String::from_utf8(decoded)
        .ok()
        .filter(|name| !name.contains('\0'))
}
