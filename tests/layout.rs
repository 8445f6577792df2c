//! The structs that Rust writes and WGSL reads have the same layout, and every shader is valid.
//!
//! Asks naga, so no GPU is needed. Failures are collected and reported together.

use palpate::geom::moments::PatchSums;
use palpate::gpu::{Wgsl, join};
use palpate::passes::body_depths::{BodyDepthUniform, BodyDepths};
use palpate::passes::depth_maps::{DepthMaps, LightViews};
use palpate::passes::diffusion::{DiffuseUniform, Diffusion};
use palpate::passes::exit::Exit;
use palpate::passes::geometry::Geometry;
use palpate::passes::green::GreenUniform;
use palpate::passes::light_path::CoverKind;
use palpate::passes::lightmap::{BlurUniform, LightMap};
use palpate::passes::moved_leaves::{self, ListedParams, MovedLeaves};
use palpate::passes::plane_carried::{self, PlaneCarried};
use palpate::passes::plane_full::{self, PlaneFull};
use palpate::passes::plane_incremental::{MovedParams, PlaneIncremental, UpdateParams};
use palpate::passes::plane_stale::{self, PlaneStale};
use palpate::passes::sampled_fit::Fit;
use palpate::passes::shadow::Shadow;
use palpate::passes::surface::Surface;
use palpate::passes::tangents::{NormalsParams, Tangents, TangentsParams};
use palpate::passes::tools::{Tools, ToolsView};
use palpate::passes::view::{FrameUniform, LightUniform};
use palpate::scene::{SurfaceKind, SurfaceSection};
use std::collections::BTreeSet;
use std::mem::offset_of;

/// Every kernel and draw, as its pass joins it.
fn shaders() -> Vec<(&'static str, &'static [Wgsl])> {
    vec![
        ("normals", Tangents::NORMALS_WGSL),
        ("tangents", Tangents::TANGENTS_WGSL),
        ("stale planes", PlaneStale::WGSL),
        ("carried planes", PlaneCarried::WGSL),
        ("full planes, sort", PlaneFull::SORT_WGSL),
        ("full planes, fit", PlaneFull::FIT_WGSL),
        ("incremental planes, moved", PlaneIncremental::MOVED_WGSL),
        ("incremental planes, update", PlaneIncremental::UPDATE_WGSL),
        ("moved leaves", MovedLeaves::WGSL),
        ("sampled planes", Fit::Plane.wgsl()),
        ("quadrics", Fit::Quadric.wgsl()),
        ("geometry", Geometry::WGSL),
        ("shadow", Shadow::WGSL),
        ("shadow of the tools", Shadow::TOOLS_WGSL),
        ("light map", LightMap::WGSL),
        ("blur", LightMap::BLUR_WGSL),
        (
            "plain",
            Surface::wgsl(SurfaceKind::Plain, CoverKind::Planes),
        ),
        (
            "subsurface",
            Surface::wgsl(SurfaceKind::Subsurface, CoverKind::Planes),
        ),
        (
            "subsurface below quadrics",
            Surface::wgsl(SurfaceKind::Subsurface, CoverKind::Quadrics),
        ),
        ("depth maps", DepthMaps::WGSL),
        ("exit", Exit::WGSL),
        ("subsurface through eight layers", through_eight_layers()),
        (
            "subsurface below depth maps",
            Surface::wgsl(SurfaceKind::Subsurface, CoverKind::DepthMaps),
        ),
        (
            "gooey",
            Surface::wgsl(SurfaceKind::Gooey, CoverKind::Planes),
        ),
        ("wrap", Surface::wgsl(SurfaceKind::Wrap, CoverKind::Planes)),
        (
            "absorption",
            Surface::wgsl(SurfaceKind::Absorption, CoverKind::Planes),
        ),
        (
            "diffusion",
            Surface::wgsl(SurfaceKind::Diffusion, CoverKind::Planes),
        ),
        ("body depths", BodyDepths::WGSL),
        ("diffusion map", Diffusion::WGSL),
        (
            "diffusion map of a translucent body",
            Diffusion::TRANSLUCENT_WGSL,
        ),
        ("diffuse", Diffusion::BLUR_WGSL),
        ("tools", Tools::WGSL),
    ]
}

/// The files are chosen by the scene, so the list lives as long as the test.
fn through_eight_layers() -> &'static [Wgsl] {
    let mut section = SurfaceSection::default();
    section.layers = vec![section.layers[0]; 8];
    Surface::parts(&section, CoverKind::DepthMaps).leak()
}

/// A Rust struct that mirrors a WGSL one.
struct Mirror {
    wgsl: &'static [Wgsl],
    name: &'static str,
    members: Vec<(&'static str, usize)>,
    size: usize,
}

/// `mirror!(WGSL, "Params", Params { a, b })`: members by name, with their offsets in Rust.
macro_rules! mirror {
    ($wgsl:expr, $name:literal, $rust:ty { $($member:ident),+ $(,)? }) => {
        Mirror {
            wgsl: $wgsl,
            name: $name,
            members: vec![$((stringify!($member), offset_of!($rust, $member))),+],
            size: size_of::<$rust>(),
        }
    };
}

fn mirrors() -> Vec<Mirror> {
    let moved = |wgsl| {
        mirror!(
            wgsl,
            "Params",
            MovedParams {
                slot_count,
                tolerance_squared_m2,
                pad0,
                pad1
            }
        )
    };
    let full = |wgsl| {
        mirror!(
            wgsl,
            "Params",
            plane_full::Params {
                slot_count,
                pad0,
                pad1,
                pad2
            }
        )
    };
    let listed = |wgsl| {
        mirror!(
            wgsl,
            "Params",
            ListedParams {
                slot_count,
                per_m,
                skip_m,
                pad0
            }
        )
    };
    let shading = Surface::wgsl(SurfaceKind::Plain, CoverKind::Planes);
    vec![
        mirror!(
            Tangents::NORMALS_WGSL,
            "Params",
            NormalsParams {
                point_count,
                pad0,
                pad1,
                pad2
            }
        ),
        mirror!(
            Tangents::TANGENTS_WGSL,
            "Params",
            TangentsParams {
                vertex_count,
                gradient_max_per_m,
                pad0,
                pad1
            }
        ),
        mirror!(
            PlaneStale::WGSL,
            "Params",
            plane_stale::Params {
                point_count,
                pad0,
                pad1,
                pad2
            }
        ),
        mirror!(
            PlaneCarried::WGSL,
            "Params",
            plane_carried::Params {
                point_count,
                pad0,
                pad1,
                pad2
            }
        ),
        full(PlaneFull::SORT_WGSL),
        full(PlaneFull::FIT_WGSL),
        moved(PlaneIncremental::MOVED_WGSL),
        mirror!(
            MovedLeaves::WGSL,
            "Params",
            moved_leaves::MovedParams {
                slot_count,
                tolerance_squared_m2,
                pad0,
                pad1
            }
        ),
        listed(Fit::Plane.wgsl()),
        listed(Fit::Quadric.wgsl()),
        mirror!(
            Surface::wgsl(SurfaceKind::Subsurface, CoverKind::DepthMaps),
            "LightViews",
            LightViews {
                clip_from_world,
                world_from_clip,
                slack_m
            }
        ),
        mirror!(
            PlaneIncremental::UPDATE_WGSL,
            "Params",
            UpdateParams {
                quanta,
                rest_per_m,
                pad0,
                pad1
            }
        ),
        mirror!(
            PlaneIncremental::UPDATE_WGSL,
            "Sums",
            PatchSums {
                origin,
                per_m,
                sum,
                pad0,
                squares,
                pad1,
                products,
                pad2
            }
        ),
        mirror!(
            LightMap::BLUR_WGSL,
            "Blur",
            BlurUniform {
                taps,
                radius_m,
                pad0,
                pad1,
                pad2
            }
        ),
        mirror!(
            BodyDepths::WGSL,
            "BodyDepth",
            BodyDepthUniform {
                clip_from_world,
                grow_m,
                pad0,
                pad1,
                pad2
            }
        ),
        mirror!(
            Diffusion::BLUR_WGSL,
            "Diffuse",
            DiffuseUniform {
                sigma_m,
                own,
                second,
                first
            }
        ),
        mirror!(
            Surface::wgsl(SurfaceKind::Absorption, CoverKind::Planes),
            "Green",
            GreenUniform {
                clip_from_world,
                spans,
                disc,
                attenuation,
                core,
                disc_radius_m,
                glow,
                ramp_per_m,
                color_in_map,
                translucency,
                pad0,
                pad1,
                pad2
            }
        ),
        mirror!(shading, "Light", LightUniform { place, power }),
        mirror!(
            shading,
            "Frame",
            FrameUniform {
                clip_from_world,
                world_from_clip,
                shadow_from_world,
                eye,
                lights,
                extinction,
                albedo,
                reflectance,
                kept,
                around,
                leaked,
                through,
                size,
                inner,
                inner_distances,
                layer_depth_max_m,
                reach_m,
                color_blend,
                multiple_scattering,
                wrap,
                layer_distance_m,
                outer_opacity,
                relief,
                roughness,
                wetness,
                shadow_depth_m,
                shadow_bias_m,
                inner_blur,
                layer_shadow,
                blur_radius_m,
                noise_m,
                noise_lookups,
                exposure,
                room_light,
                pad0,
            }
        ),
        mirror!(
            Tools::WGSL,
            "View",
            ToolsView {
                clip_from_world,
                eye_exposure
            }
        ),
    ]
}

/// (name, offset) of each member of the WGSL struct `name`, and its size in bytes.
fn wgsl_layout(source: &str, name: &str) -> Option<(Vec<(String, usize)>, usize)> {
    let module = naga::front::wgsl::parse_str(source).expect("WGSL parses");
    let (_, ty) = module
        .types
        .iter()
        .find(|(_, ty)| ty.name.as_deref() == Some(name))?;
    let naga::TypeInner::Struct { members, span } = &ty.inner else {
        return None;
    };
    let members = members
        .iter()
        .map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize))
        .collect();
    Some((members, *span as usize))
}

/// What is wrong with a mirror, if anything.
fn layout_fault(source: &str, mirror: &Mirror) -> Option<String> {
    let Some((members, size)) = wgsl_layout(source, mirror.name) else {
        return Some(format!("there is no struct {} in WGSL", mirror.name));
    };
    let rust: Vec<_> = mirror
        .members
        .iter()
        .map(|&(name, offset)| (name.to_owned(), offset))
        .collect();
    ((members, size) != (rust.clone(), mirror.size)).then(|| {
        let (members, size) = wgsl_layout(source, mirror.name).expect("found above");
        format!(
            "struct {} of {}:\n  WGSL {size} bytes {members:?}\n  Rust {} bytes {rust:?}",
            mirror.name,
            mirror.wgsl[mirror.wgsl.len() - 1].file,
            mirror.size
        )
    })
}

/// Why `source` is no valid WGSL, if it is not.
fn validity_fault(source: &str) -> Option<String> {
    let module = match naga::front::wgsl::parse_str(source) {
        Ok(module) => module,
        Err(error) => return Some(error.emit_to_string(source)),
    };
    naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        // What every WebGPU device has; the first is `unpack2x16float`.
        naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32 | naga::valid::Capabilities::default(),
    )
    .validate(&module)
    .err()
    .map(|error| error.emit_to_string(source))
}

#[test]
fn rust_and_wgsl_structs_have_the_same_layout() {
    let faults: Vec<String> = mirrors()
        .iter()
        .filter_map(|mirror| layout_fault(&join(mirror.wgsl), mirror))
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn layout_check_rejects_a_moved_and_a_missing_member() {
    let source = join(Tangents::TANGENTS_WGSL);
    let mirror = mirrors().swap_remove(1);
    for (from, to) in [
        (
            "vertex_count: u32,\n    gradient_max_per_m: f32,",
            "gradient_max_per_m: f32,\n    vertex_count: u32,",
        ),
        ("    pad1: u32,\n", ""),
    ] {
        let sabotaged = source.replace(from, to);
        assert_ne!(sabotaged, source, "the sabotage must change the struct");
        assert!(
            layout_fault(&sabotaged, &mirror).is_some(),
            "{to} went unnoticed"
        );
    }
}

#[test]
fn every_uniform_struct_has_a_mirror() {
    let mirrors = mirrors();
    let mut faults = Vec::new();
    for (name, parts) in shaders() {
        let source = join(parts);
        let module = naga::front::wgsl::parse_str(&source).expect("WGSL parses");
        for (_, variable) in module.global_variables.iter() {
            let ty = &module.types[variable.ty];
            let is_struct = matches!(ty.inner, naga::TypeInner::Struct { .. });
            if variable.space != naga::AddressSpace::Uniform || !is_struct {
                continue;
            }
            let struct_name = ty.name.as_deref().expect("structs have names");
            // Several passes join the file that declares a struct they share.
            let declares = |part: &&Wgsl| part.source.contains(&format!("struct {struct_name} {{"));
            let file = parts.iter().find(declares).expect("declared").file;
            let mirrored = mirrors.iter().any(|mirror| {
                mirror.name == struct_name && mirror.wgsl.iter().any(|part| part.file == file)
            });
            if !mirrored {
                faults.push(format!("{name}: struct {struct_name} of {file}"));
            }
        }
    }
    assert!(faults.is_empty(), "without a mirror: {faults:?}");
}

#[test]
fn every_pass_is_valid_wgsl() {
    let faults: Vec<String> = shaders()
        .iter()
        .filter_map(|(name, parts)| {
            validity_fault(&join(parts)).map(|fault| format!("{name}: {fault}"))
        })
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn validity_check_rejects_a_wrong_type_and_a_lost_brace() {
    let source = join(PlaneFull::FIT_WGSL);
    for (from, to) in [("var count = 0u", "var count = 0.5"), ("}", "")] {
        let sabotaged = source.replacen(from, to, 1);
        assert_ne!(sabotaged, source, "the sabotage must change the kernel");
        assert!(validity_fault(&sabotaged).is_some(), "{to} went unnoticed");
    }
}

#[test]
fn every_shader_file_is_part_of_a_checked_pass() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/shaders");
    let files: BTreeSet<String> = std::fs::read_dir(folder)
        .expect("the shaders are there")
        .map(|entry| entry.expect("can be listed").file_name())
        .map(|name| format!("shaders/{}", name.to_string_lossy()))
        .collect();
    let checked: BTreeSet<String> = shaders()
        .iter()
        .flat_map(|(_, parts)| parts.iter().map(|part| part.file.to_owned()))
        .collect();
    assert_eq!(files, checked);
}
