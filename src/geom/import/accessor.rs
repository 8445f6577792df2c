//! glTF accessors: every range is checked against the bytes before a number is read.

use super::error::ImportFault;
use ::gltf::json::accessor::{Accessor, ComponentType, Type};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Root, buffer};

/// What a sparse accessor without a buffer view starts from: the largest element read is VEC3 of FLOAT.
static ZEROS: [u8; 12] = [0; 12];

/// The JSON of a glTF file and the bytes of its buffers.
pub(super) struct Document<'a> {
    pub root: &'a Root,
    pub buffers: Vec<Vec<u8>>,
}

/// What an accessor is read as.
#[derive(Clone, Copy)]
enum Content {
    Positions,
    TextureCoordinates,
    Indices,
}

/// A strided run of elements whose last byte is known to exist.
struct Run<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
}

impl<'a> Run<'a> {
    fn element(&self, index: usize) -> &'a [u8] {
        &self.bytes[index * self.stride..]
    }
}

impl Document<'_> {
    /// The bytes of a buffer view.
    pub fn view(&self, index: Index<buffer::View>) -> Result<&[u8], ImportFault> {
        let place = || format!("bufferViews[{}]", index.value());
        let view = self.root.buffer_views.get(index.value());
        let view = view.ok_or_else(|| ImportFault::malformed(place(), "there is no such view"))?;
        let buffer = self.buffers.get(view.buffer.value()).ok_or_else(|| {
            let problem = format!("there is no buffers[{}]", view.buffer.value());
            ImportFault::malformed(place(), problem)
        })?;
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let end = start.checked_add(view.byte_length.0);
        match end {
            Some(end) if end <= buffer.len() as u64 => Ok(&buffer[start as usize..end as usize]),
            _ => Err(ImportFault::malformed(
                place(),
                format!(
                    "{} bytes from {start} reach beyond the {} bytes of buffers[{}]",
                    view.byte_length.0,
                    buffer.len(),
                    view.buffer.value()
                ),
            )),
        }
    }

    /// Number of elements that accessor `index` claims.
    pub fn count(&self, index: Index<Accessor>) -> Result<u64, ImportFault> {
        Ok(self.accessor(index)?.count.0)
    }

    /// Positions of a primitive.
    pub fn positions(&self, index: Index<Accessor>) -> Result<Vec<[f32; 3]>, ImportFault> {
        self.floats(index, Content::Positions)
    }

    /// Texture coordinates of a primitive.
    pub fn uvs(&self, index: Index<Accessor>) -> Result<Vec<[f32; 2]>, ImportFault> {
        self.floats(index, Content::TextureCoordinates)
    }

    /// Indices of a primitive, not yet checked against its vertices.
    pub fn indices(&self, index: Index<Accessor>) -> Result<Vec<u32>, ImportFault> {
        let component = self.check_type(index, Content::Indices)?;
        let elements = self.elements(index, component_bytes(component))?;
        Ok(elements.iter().map(|e| unsigned(e, component)).collect())
    }

    fn accessor(&self, index: Index<Accessor>) -> Result<&Accessor, ImportFault> {
        self.root.accessors.get(index.value()).ok_or_else(|| {
            let place = format!("accessors[{}]", index.value());
            ImportFault::malformed(place, "there is no such accessor")
        })
    }

    fn floats<const N: usize>(
        &self,
        index: Index<Accessor>,
        content: Content,
    ) -> Result<Vec<[f32; N]>, ImportFault> {
        let component = self.check_type(index, content)?;
        let size = component_bytes(component);
        let elements = self.elements(index, N * size)?;
        Ok(elements
            .iter()
            .map(|e| std::array::from_fn(|k| float(&e[k * size..], component)))
            .collect())
    }

    /// The component type, if type and component type are ones that `content` may have.
    fn check_type(
        &self,
        index: Index<Accessor>,
        content: Content,
    ) -> Result<ComponentType, ImportFault> {
        use ComponentType::{F32, U8, U16, U32};
        let accessor = self.accessor(index)?;
        let place = format!("accessors[{}]", index.value());
        let (Checked::Valid(kind), Checked::Valid(component)) =
            (&accessor.type_, &accessor.component_type)
        else {
            let problem = "type or componentType is none that glTF knows";
            return Err(ImportFault::malformed(place, problem));
        };
        let (component, normalized) = (component.0, accessor.normalized);
        let (fits, rule) = match content {
            Content::Positions => (
                (*kind, component) == (Type::Vec3, F32),
                "positions must be VEC3 of FLOAT",
            ),
            Content::TextureCoordinates => (
                *kind == Type::Vec2
                    && (component == F32 || matches!(component, U8 | U16) && normalized),
                "texture coordinates must be VEC2 of FLOAT or of normalized UNSIGNED_BYTE or \
                 UNSIGNED_SHORT",
            ),
            Content::Indices => (
                *kind == Type::Scalar && matches!(component, U8 | U16 | U32),
                "indices must be SCALAR of an unsigned integer",
            ),
        };
        if !fits {
            return Err(ImportFault::malformed(place, rule));
        }
        Ok(component)
    }

    /// The bytes of each element, with the sparse substitution applied.
    fn elements(&self, index: Index<Accessor>, size: usize) -> Result<Vec<&[u8]>, ImportFault> {
        let accessor = self.accessor(index)?;
        let place = format!("accessors[{}]", index.value());
        let bad = |problem: String| ImportFault::malformed(place.clone(), problem);
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        let count = accessor.count.0;
        if count == 0 {
            return Err(bad("it holds no elements".to_owned()));
        }
        let mut elements = match accessor.buffer_view {
            Some(view) => {
                let run = self.run(view, offset, count, size, &place)?;
                (0..run.count).map(|k| &run.element(k)[..size]).collect()
            }
            None if accessor.sparse.is_none() => {
                return Err(bad(
                    "it has neither a bufferView nor sparse values".to_owned()
                ));
            }
            None => {
                // Zeros cost the file nothing, so its size has to be the bound.
                let held: usize = self.buffers.iter().map(Vec::len).sum();
                if count > held as u64 {
                    let problem = format!("{count} elements claimed by a file with {held} bytes");
                    return Err(bad(problem));
                }
                vec![&ZEROS[..size]; count as usize]
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let place = format!("{place}.sparse");
            let Checked::Valid(component) = &sparse.indices.component_type else {
                return Err(ImportFault::malformed(place, "unknown componentType"));
            };
            let (indices, values) = (&sparse.indices, &sparse.values);
            let component = component.0;
            let width = component_bytes(component);
            let (at, from) = (indices.byte_offset.0, values.byte_offset.0);
            let count = sparse.count.0;
            let targets = self.run(indices.buffer_view, at, count, width, &place)?;
            let values = self.run(values.buffer_view, from, count, size, &place)?;
            for k in 0..targets.count {
                let target = unsigned(targets.element(k), component) as usize;
                let element = elements.get_mut(target).ok_or_else(|| {
                    let problem =
                        format!("index {target} is beyond the {} elements", accessor.count.0);
                    ImportFault::malformed(place.clone(), problem)
                })?;
                *element = &values.element(k)[..size];
            }
        }
        Ok(elements)
    }

    /// `count` elements of `size` bytes from `offset` in a view.
    fn run(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: u64,
        size: usize,
        place: &str,
    ) -> Result<Run<'_>, ImportFault> {
        let bytes = self.view(view)?;
        let stride = self.root.buffer_views[view.value()].byte_stride;
        let stride = stride.map_or(size, |stride| stride.0);
        if stride < size || stride > 252 {
            return Err(ImportFault::malformed(
                place,
                format!("a byteStride of {stride} does not hold elements of {size} bytes"),
            ));
        }
        // Last byte = offset + (count - 1) stride + size; no step may wrap.
        let end = count
            .checked_sub(1)
            .and_then(|gaps| gaps.checked_mul(stride as u64))
            .and_then(|bytes| bytes.checked_add(size as u64))
            .and_then(|bytes| bytes.checked_add(offset));
        match end {
            Some(end) if end <= bytes.len() as u64 => Ok(Run {
                bytes: &bytes[offset as usize..],
                stride,
                count: count as usize,
            }),
            _ => Err(ImportFault::malformed(
                place,
                format!(
                    "{count} elements of {size} bytes from byte {offset} do not fit into the {} \
                     bytes of bufferViews[{}]",
                    bytes.len(),
                    view.value()
                ),
            )),
        }
    }
}

fn component_bytes(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

/// First component of `bytes` as an unsigned integer; signed and float types are refused before.
fn unsigned(bytes: &[u8], component: ComponentType) -> u32 {
    let bytes = &bytes[..component_bytes(component)];
    let mut word = [0; 4];
    word[..bytes.len()].copy_from_slice(bytes);
    u32::from_le_bytes(word)
}

/// First component of `bytes` as a float; integers are normalized to 0..1.
fn float(bytes: &[u8], component: ComponentType) -> f32 {
    let bits = unsigned(bytes, component);
    match component {
        ComponentType::F32 => f32::from_bits(bits),
        ComponentType::U8 => bits as f32 / 255.0,
        _ => bits as f32 / 65535.0,
    }
}
