//! Joins WGSL files and compiles them; errors name a file that exists.

use super::{Gpu, GpuError};

/// One WGSL file, embedded in the binary.
#[derive(Clone, Copy, Debug)]
pub struct Wgsl {
    /// Path inside the project, for messages.
    pub file: &'static str,
    /// Its text.
    pub source: &'static str,
}

/// The text of all `parts`, in order.
pub fn join(parts: &[Wgsl]) -> String {
    parts.iter().map(|part| part.source).collect()
}

/// Compiles `source`, which is [`join`]ed from `parts` or a changed copy of it.
///
/// # Errors
///
/// [`GpuError::Shader`] with the file and the line in it.
pub fn compile(
    gpu: &Gpu,
    pass: &'static str,
    parts: &[Wgsl],
    source: &str,
) -> Result<wgpu::ShaderModule, GpuError> {
    let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(pass),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
    if pollster::block_on(scope.pop()).is_none() {
        return Ok(module);
    }
    let info = pollster::block_on(module.get_compilation_info());
    let message = info
        .messages
        .iter()
        .map(|m| {
            let place = m
                .location
                .map(|at| locate(parts, at.line_number as usize, at.line_position as usize))
                .unwrap_or_default();
            format!("{place}{}", m.message)
        })
        .collect::<Vec<_>>()
        .join("\n");
    Err(GpuError::Shader { pass, message })
}

/// `file:line:column: ` of a line of the joined text; nothing if it lies past the end.
fn locate(parts: &[Wgsl], line: usize, column: usize) -> String {
    let mut first = 1;
    for part in parts {
        let lines = part.source.matches('\n').count();
        if line < first + lines {
            return format!("{}:{}:{column}: ", part.file, line - first + 1);
        }
        first += lines;
    }
    String::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARTS: [Wgsl; 2] = [
        Wgsl {
            file: "shaders/a.wgsl",
            source: "one\ntwo\n",
        },
        Wgsl {
            file: "shaders/b.wgsl",
            source: "three\nfour\n",
        },
    ];

    #[test]
    fn a_joined_line_is_located_in_the_file_it_came_from() {
        assert_eq!(locate(&PARTS, 2, 1), "shaders/a.wgsl:2:1: ");
        assert_eq!(locate(&PARTS, 3, 5), "shaders/b.wgsl:1:5: ");
        assert_eq!(locate(&PARTS, 4, 1), "shaders/b.wgsl:2:1: ");
        assert_eq!(locate(&PARTS, 9, 1), "");
    }
}
