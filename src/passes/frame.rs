//! The passes of a scene, and one frame of them in order.

use super::DEPTH_FORMAT;
use super::backdrop::backdrop;
use super::body_depths::BodyDepths;
use super::depth_maps::DepthMaps;
use super::diffusion::{Diffusion, DiffusionInputs};
use super::draw::{Output, Target};
use super::exit::Exit;
use super::geometry::{Geometry, GeometryTargets};
use super::green::Green;
use super::light_path::{LightPath, LightPathKnobs, RefitCounts, patch_share};
use super::lightmap::{LightMap, LightMapInputs, uv_per_m};
use super::maps::Maps;
use super::mesh_buffers::MeshBuffers;
use super::plane_carried::PlaneCarried;
use super::plane_full::PlaneFull;
use super::plane_incremental::PlaneIncremental;
use super::plane_stale::PlaneStale;
use super::sampled_fit::Fit;
use super::shadow::Shadow;
use super::surface::{Surface, SurfaceInputs};
use super::tangents::Tangents;
use super::tools::{DrawnTool, Tools, ToolsView};
use super::view::{
    FrameUniform, View, light_constants, map_level, placed_lights, shadow_from_world,
};
use crate::geom::SurfaceMesh;
use crate::geom::paint::TissueMaps;
use crate::geom::patch::radius_from_extinction_m;
use crate::geom::plane::{LightPathMethod, skip_from_optical_depth_m};
use crate::gpu::{Gpu, GpuError, Timer, uniform};
use crate::scene::{Multiple, PlacedLight, RestBox, Scene, SurfaceKind, SurfaceSection};
use glam::{Mat4, Vec3};

/// Light that is left at the radius of a patch: ε of François 2006, section 2.2.
const PATCH_EPSILON: f32 = 0.01;

/// What a frame records, in order. A pass that the scene does not ask for is never built.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePlan {
    /// Name of each pass and its dispatches or draws, in the order they are recorded.
    pub passes: Vec<(&'static str, u32)>,
    /// Names of passes that other scenes have and this one does not.
    pub left_out: Vec<&'static str>,
}

impl FramePlan {
    /// Decides from plain data, without a GPU.
    pub fn for_scene(scene: &Scene) -> Self {
        let kind = scene.surface.kind;
        let method = effective_method(scene);
        let shadow = scene.lights.iter().any(|light| light.shadow);
        let by_depth = method == Some(LightPathMethod::DepthMap);
        let gooey = kind == SurfaceKind::Gooey;
        let light_map = scene.surface.has_light_map();
        let blurs = scene.surface.blur_passes;
        let translucent = scene.surface.is_translucent();
        let body_depths =
            BodyDepths::draws(scene.lights.len(), scene.surface.absorption.depth_layers);
        let diffusion = kind == SurfaceKind::Diffusion;
        let diffuse = 2 * Diffusion::blurred_gaussians(&scene.surface).len() as u32;
        let all = [
            (Tangents::NAME, 2, true),
            (PlaneStale::NAME, 1, method == Some(LightPathMethod::Stale)),
            (
                PlaneCarried::NAME,
                1,
                method == Some(LightPathMethod::Carried),
            ),
            (PlaneFull::NAME, 2, method == Some(LightPathMethod::Full)),
            (
                PlaneIncremental::NAME,
                2,
                method == Some(LightPathMethod::Incremental),
            ),
            (
                Fit::Plane.name(),
                2,
                method == Some(LightPathMethod::Sampled),
            ),
            (
                Fit::Quadric.name(),
                2,
                method == Some(LightPathMethod::Quadric),
            ),
            (DepthMaps::NAME, scene.lights.len() as u32, by_depth),
            (Exit::NAME, 1, by_depth),
            (BodyDepths::NAME, body_depths, translucent),
            (
                Shadow::NAME,
                1 + u32::from(!scene.tools.is_empty()),
                shadow && !by_depth && !translucent,
            ),
            (LightMap::NAME, 1, light_map),
            (LightMap::BLUR_NAME, blurs, light_map && blurs > 0),
            (Diffusion::NAME, 1, diffusion),
            (Diffusion::BLUR_NAME, diffuse, diffusion),
            (Geometry::NAME, 1, true),
            ("plain", 1, kind == SurfaceKind::Plain),
            ("subsurface", 1, kind == SurfaceKind::Subsurface),
            ("gooey", 1, gooey),
            ("wrap", 1, kind == SurfaceKind::Wrap),
            ("absorption", 1, kind == SurfaceKind::Absorption),
            ("diffusion", 1, diffusion),
            (Tools::NAME, 1, !scene.tools.is_empty()),
        ];
        Self {
            passes: all
                .iter()
                .filter(|(_, _, wanted)| *wanted)
                .map(|&(name, count, _)| (name, count))
                .collect(),
            left_out: all
                .iter()
                .filter(|(_, _, wanted)| !wanted)
                .map(|&(name, _, _)| name)
                .collect(),
        }
    }

    /// The same for a run that draws nothing: every pass is left out.
    pub fn undrawn(self) -> Self {
        let passes = self.passes.into_iter().map(|(name, _)| name);
        Self {
            left_out: passes.chain(self.left_out).collect(),
            passes: Vec::new(),
        }
    }

    /// Dispatches or draws of the pass called `name` in a frame.
    pub fn count_of(&self, name: &str) -> u32 {
        self.passes
            .iter()
            .find(|(pass, _)| *pass == name)
            .map_or(0, |&(_, count)| count)
    }
}

/// The light path of a scene; nothing where its surface marches no light.
pub fn effective_method(scene: &Scene) -> Option<LightPathMethod> {
    (scene.surface.kind == SurfaceKind::Subsurface).then_some(scene.light_path.method)
}

/// Radius of a ball as thick as a body at rest [m]; `None` of a sheet, which has no other side.
fn thick_as_m(rest: &RestBox) -> Option<f32> {
    let extent = rest.high - rest.low;
    let thin = extent.min_element();
    (thin > 1e-3 * extent.max_element()).then_some(0.5 * thin)
}

/// All passes of one scene and what they draw into.
pub struct FramePasses {
    /// The mesh on the GPU.
    pub mesh: MeshBuffers,
    /// Normals, tangents and texture gradients.
    pub tangents: Tangents,
    /// Light-path planes.
    pub light_path: LightPath,
    /// What lies at each pixel, and its depth.
    pub targets: GeometryTargets,
    /// The finished picture, or its radiance with coverage in alpha.
    pub target: Target,
    /// What a picture begins with.
    backdrop: Option<Target>,
    output: Output,
    shadow: Option<Shadow>,
    depth_maps: Option<DepthMaps>,
    exit: Option<Exit>,
    light_map: Option<LightMap>,
    green: Option<Green>,
    diffusion: Option<Diffusion>,
    geometry: Geometry,
    surface: Surface,
    maps: Maps,
    /// Stands for the shadow map where there is none; never read.
    no_shadow: Target,
    tools: Tools,
    frame: wgpu::Buffer,
    lights: Vec<PlacedLight>,
    knobs: SurfaceSection,
    /// Radius of a ball as thick as the body [m]; `None` of a sheet, and where nothing leaks.
    thick_as_m: Option<f32>,
    uv_per_m: f32,
    map_size_px: u32,
    size: [u32; 2],
}

/// The map that says where light 0 enters the body.
fn shadow_map<'a>(
    shadow: Option<&'a Shadow>,
    depth_maps: Option<&'a DepthMaps>,
    green: Option<&'a Green>,
    none: &'a Target,
) -> &'a Target {
    let of_all = depth_maps.map(|maps| &maps.depth);
    let entries = green.and_then(Green::depths).map(BodyDepths::entries);
    shadow
        .map(|shadow| &shadow.target)
        .or(of_all)
        .or(entries)
        .unwrap_or(none)
}

/// The light map that the surface reads; any texture where it reads none.
fn read_light_map<'a>(
    gooey: Option<&'a LightMap>,
    diffusion: Option<&'a Diffusion>,
    maps: &'a Maps,
) -> &'a wgpu::TextureView {
    gooey
        .map(LightMap::view)
        .or(diffusion.map(Diffusion::view))
        .unwrap_or(maps.outer.at(0))
}

/// How far light is followed below the surface of a scene [m]: the told radius, or from the densest layer's extinction.
pub fn light_radius_m(scene: &Scene) -> f32 {
    scene.light_path.radius_m.unwrap_or_else(|| {
        radius_from_extinction_m(scene.surface.bounding_extinction_per_m(), PATCH_EPSILON)
    })
}

/// Radius of the patches of a scene [m]: told, or the share of [`light_radius_m`] that the method fits best over.
pub fn patch_radius_m(scene: &Scene) -> f32 {
    let told = scene.light_path.radius_m;
    told.unwrap_or_else(|| patch_share(scene.light_path.method) * light_radius_m(scene))
}

/// How far a point may lie from where its patches last saw it [m]: told, or a share of their radius.
///
/// What lags by a share of the radius turns a plane by about as many radians, by more where the patch is
/// nearly as thick as wide: a 4000th turned the planes of a prodded spleen by 0.03 degrees at the 99.9th
/// percentile, a 2000th by 0.07, and 0.05 is asked for (`tests/accuracy.rs`).
pub fn tolerance_m(scene: &Scene) -> f32 {
    let told = scene.light_path.tolerance_m;
    told.unwrap_or_else(|| patch_radius_m(scene) / 4000.0)
}

/// What the light path of a scene is built from.
pub fn light_path_knobs(scene: &Scene) -> LightPathKnobs {
    LightPathKnobs {
        method: effective_method(scene).unwrap_or(LightPathMethod::Tangent),
        radius_m: patch_radius_m(scene),
        tolerance_m: tolerance_m(scene),
        skip_m: skip_from_optical_depth_m(
            scene.light_path.skip_optical_depth,
            scene.surface.bounding_extinction_per_m(),
        ),
    }
}

impl FramePasses {
    /// Builds what `scene` needs and nothing else, for an `output` of `size` [px].
    ///
    /// # Errors
    ///
    /// [`GpuError`] naming the pass and what the adapter refused.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        rest: &RestBox,
        surface_mesh: &SurfaceMesh,
        tissue: &TissueMaps,
        size: [u32; 2],
        output: Output,
    ) -> Result<Self, GpuError> {
        let mesh = MeshBuffers::new(gpu, surface_mesh)?;
        let tangents = Tangents::new(gpu, surface_mesh, &mesh)?;
        let light_path =
            LightPath::new(gpu, light_path_knobs(scene), surface_mesh, &mesh, &tangents)?;
        let lights = placed_lights(scene, rest);
        // Depth maps hold the shadow map too.
        let depth_maps = if matches!(light_path, LightPath::DepthMap) {
            Some(DepthMaps::new(gpu, surface_mesh, lights.len(), &tangents)?)
        } else {
            None
        };
        let green = if matches!(
            scene.surface.kind,
            SurfaceKind::Wrap | SurfaceKind::Absorption | SurfaceKind::Diffusion
        ) {
            let count = lights.len();
            let green = Green::new(gpu, &scene.surface, count, surface_mesh, &tangents, tissue)?;
            Some(green)
        } else {
            None
        };
        // And so do those of light that comes through the body.
        let has_entries = depth_maps.is_some() || scene.surface.is_translucent();
        let tools = Tools::new(gpu, output)?;
        let shadow = if !has_entries && lights.iter().any(|light| light.shadow) {
            Some(Shadow::new(gpu, surface_mesh, &tools)?)
        } else {
            None
        };
        let uv_per_m = uv_per_m(surface_mesh);
        let view = View {
            eye: Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_y: 1.0,
        };
        let frame = uniform(
            gpu,
            "frame",
            &FrameUniform::new(&view, size, &lights, &scene.surface, Mat4::IDENTITY),
        );
        let exit = if depth_maps.is_some() {
            Some(Exit::new(gpu, surface_mesh, &frame, size)?)
        } else {
            None
        };
        let constants = light_constants(&lights);
        let maps = Maps::new(gpu, tissue, scene.surface.noise);
        let no_shadow = Target::new(gpu, "no shadow", [1; 2], DEPTH_FORMAT);
        let shadow_map = shadow_map(
            shadow.as_ref(),
            depth_maps.as_ref(),
            green.as_ref(),
            &no_shadow,
        );
        let diffusion = match &green {
            Some(green) if scene.surface.kind == SurfaceKind::Diffusion => Some(Diffusion::new(
                gpu,
                &scene.surface,
                surface_mesh,
                &DiffusionInputs {
                    frame: &frame,
                    light_constants: &constants,
                    mesh: &mesh,
                    tangents: &tangents,
                    maps: &maps,
                    map_size_px: tissue.size_px,
                    shadow_map: &shadow_map.view,
                    green,
                },
            )?),
            _ => None,
        };
        let light_map = if scene.surface.has_light_map() {
            Some(LightMap::new(
                gpu,
                &scene.surface,
                surface_mesh,
                &LightMapInputs {
                    frame: &frame,
                    light_constants: &constants,
                    mesh: &mesh,
                    tangents: &tangents,
                    maps: &maps,
                    map_size_px: tissue.size_px,
                    shadow_map: &shadow_map.view,
                },
            )?)
        } else {
            None
        };
        let geometry = Geometry::new(
            gpu,
            &scene.surface,
            &frame,
            surface_mesh,
            &mesh,
            &tangents,
            light_path.primitives(),
        )?;
        let targets = GeometryTargets::new(gpu, scene.surface.kind, size);
        let surface = Surface::new(
            gpu,
            &scene.surface,
            output,
            &SurfaceInputs {
                frame: &frame,
                light_constants: &constants,
                cover: light_path.primitives().cover(),
                geometry: &targets,
                maps: &maps,
                light_map: read_light_map(light_map.as_ref(), diffusion.as_ref(), &maps),
                shadow_map: &shadow_map.view,
                exit_map: &exit.as_ref().map_or(shadow_map, |exit| &exit.target).view,
                depth_maps: depth_maps.as_ref(),
                green: green.as_ref(),
            },
        )?;
        Ok(Self {
            tools,
            target: Target::new(gpu, "output", size, output.format()),
            backdrop: (output == Output::Picture).then(|| backdrop(gpu, size)),
            output,
            mesh,
            tangents,
            light_path,
            targets,
            shadow,
            depth_maps,
            exit,
            light_map,
            green,
            diffusion,
            geometry,
            surface,
            maps,
            no_shadow,
            frame,
            lights,
            knobs: scene.surface.clone(),
            thick_as_m: thick_as_m(rest).filter(|_| scene.surface.multiple == Multiple::Calibrated),
            uv_per_m,
            map_size_px: tissue.size_px,
            size,
        })
    }

    /// Width and height of the picture [px].
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Makes the picture another size.
    pub fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) {
        self.target = Target::new(gpu, "output", size, self.output.format());
        self.backdrop = (self.output == Output::Picture).then(|| backdrop(gpu, size));
        self.targets = GeometryTargets::new(gpu, self.knobs.kind, size);
        if let Some(exit) = &mut self.exit {
            exit.resize(gpu, size);
        }
        let constants = light_constants(&self.lights);
        let sets = self.surface.bound(gpu, &self.surface_inputs(&constants));
        self.surface.rebind(sets);
        self.size = size;
    }

    /// The level of the maps that suits `view`.
    fn map_level(&self, view: &View) -> usize {
        map_level(view, self.size[1], self.uv_per_m * self.map_size_px as f32)
    }

    /// What the surface reads.
    fn surface_inputs<'a>(
        &'a self,
        light_constants: &'a [(&'static str, f64)],
    ) -> SurfaceInputs<'a> {
        let (depth_maps, green) = (self.depth_maps.as_ref(), self.green.as_ref());
        let shadow_map = shadow_map(self.shadow.as_ref(), depth_maps, green, &self.no_shadow);
        let exit_map = self.exit.as_ref().map_or(shadow_map, |exit| &exit.target);
        let (gooey, diffusion) = (self.light_map.as_ref(), self.diffusion.as_ref());
        SurfaceInputs {
            frame: &self.frame,
            light_constants,
            cover: self.light_path.primitives().cover(),
            geometry: &self.targets,
            maps: &self.maps,
            light_map: read_light_map(gooey, diffusion, &self.maps),
            shadow_map: &shadow_map.view,
            exit_map: &exit_map.view,
            depth_maps,
            green,
        }
    }

    /// Radiance of the frame that was recorded and submitted last, whatever its output: the surface and `tools` are drawn
    /// once more by pipelines that are made for it. Costs too much for every frame.
    ///
    /// # Errors
    ///
    /// [`GpuError`] naming the pass that can't be built.
    pub fn radiance(
        &self,
        gpu: &Gpu,
        view: &View,
        tools: &[DrawnTool],
    ) -> Result<Target, GpuError> {
        let output = Output::Radiance;
        let target = Target::new(gpu, "radiance", self.size, output.format());
        let constants = light_constants(&self.lights);
        let inputs = self.surface_inputs(&constants);
        let surface = Surface::new(gpu, &self.knobs, output, &inputs)?;
        let tools_pass = Tools::new(gpu, output)?;
        let mut timer = Timer::off();
        let mut encoder = gpu.encoder();
        let depth = &self.targets.depth;
        let level = self.map_level(view);
        surface.record(&target, depth, level, &mut encoder, &mut timer);
        let aspect = self.size[0] as f32 / self.size[1] as f32;
        let view = ToolsView::new(view, aspect, self.knobs.exposure);
        let views = [&target.view, &depth.view];
        tools_pass.record(gpu, &view, tools, views, &mut encoder, &mut timer);
        gpu.submit_and_wait(encoder);
        Ok(target)
    }

    /// The maps that say where light enters, where the light path asks for them.
    pub fn depth_maps(&self) -> Option<&DepthMaps> {
        self.depth_maps.as_ref()
    }

    /// The lights, the one that casts shadows first.
    pub fn lights(&self) -> &[PlacedLight] {
        &self.lights
    }

    /// Takes over changed knobs of the surface; what needs other passes needs [`FramePasses::new`].
    pub fn set_knobs(&mut self, gpu: &Gpu, section: &SurfaceSection) {
        self.knobs = section.clone();
        if let Some(green) = &self.green {
            green.set_knobs(gpu, section);
        }
    }

    /// Takes over lights that were turned or dimmed; other kinds of light need [`FramePasses::new`].
    pub fn set_lights(&mut self, scene: &Scene, rest: &RestBox) {
        let lights = placed_lights(scene, rest);
        if light_constants(&lights) == light_constants(&self.lights) {
            self.lights = lights;
        }
    }

    /// Takes `colors`, evenly from no way to the longest, for what is left of light that comes through the body.
    pub fn set_ramp(&mut self, gpu: &Gpu, colors: Vec<Vec3>) {
        if let Some(green) = &mut self.green {
            green.set_ramp(gpu, &self.knobs, colors);
        }
    }

    /// The light map of the surface `gooey`.
    pub fn light_map(&self) -> Option<&LightMap> {
        self.light_map.as_ref()
    }

    /// The light map of the surface `diffusion`.
    pub fn diffusion(&self) -> Option<&Diffusion> {
        self.diffusion.as_ref()
    }

    /// Records one frame: the surface lies at `points`, seen by `view`, with `tools` over it.
    pub fn record(
        &self,
        gpu: &Gpu,
        points: &[Vec3],
        view: &View,
        tools: &[DrawnTool],
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let shadow_from_world = match self.lights.first() {
            Some(light) if light.shadow => shadow_from_world(light.place, points),
            _ => Mat4::IDENTITY,
        };
        let frame = FrameUniform::new(
            view,
            self.size,
            &self.lights,
            &self.knobs,
            shadow_from_world,
        );
        let frame = match self.thick_as_m {
            Some(radius_m) => frame.leaking(&self.knobs, radius_m),
            None => frame,
        };
        gpu.queue
            .write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        self.mesh.upload(gpu, points);

        // Normals, tangents and texture gradients of the surface as it lies now.
        self.tangents.record(encoder, timer);
        // Planes of the patches, as far as the method brings them up to date.
        self.light_path.record(encoder, timer);
        // Where the first light is cut off.
        if let Some(shadow) = &self.shadow {
            let (mesh, map) = (&self.mesh, shadow_from_world);
            shadow.record(gpu, map, mesh, &self.tools, tools.len(), encoder, timer);
        }
        // Where each light enters.
        if let Some(maps) = &self.depth_maps {
            maps.record(gpu, &self.lights, points, &self.mesh, encoder, timer);
        }
        // Where the eye's rays leave.
        if let Some(exit) = &self.exit {
            exit.record(&self.mesh, encoder, timer);
        }
        // Irradiance in texture space, blurred; only the gooey surface reads it.
        if let Some(light_map) = &self.light_map {
            light_map.record(gpu, self.knobs.blur_radius_m, &self.mesh, encoder, timer);
        }
        // Where light that comes through the body enters and leaves it.
        if let Some(green) = &self.green {
            let lights = &self.lights;
            green.record(gpu, &self.knobs, lights, points, &self.mesh, encoder, timer);
        }
        // Irradiance in texture space, blurred by as far as light wanders.
        if let Some(diffusion) = &self.diffusion {
            diffusion.record(gpu, &self.knobs, &self.mesh, encoder, timer);
        }
        // What lies at each pixel.
        self.geometry
            .record(&self.mesh, &self.tangents, &self.targets, encoder, timer);
        if let Some(backdrop) = &self.backdrop {
            encoder.copy_texture_to_texture(
                backdrop.texture.as_image_copy(),
                self.target.texture.as_image_copy(),
                self.target.texture.size(),
            );
        }
        // The one surface model of the scene.
        let (depth, level) = (&self.targets.depth, self.map_level(view));
        self.surface
            .record(&self.target, depth, level, encoder, timer);
        // What prods it.
        let aspect = self.size[0] as f32 / self.size[1] as f32;
        let view = ToolsView::new(view, aspect, self.knobs.exposure);
        let views = [&self.target.view, &self.targets.depth.view];
        self.tools.record(gpu, &view, tools, views, encoder, timer);
    }

    /// What the last submitted frame fitted.
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if the counts can't be read.
    pub fn refit_counts(&self, gpu: &Gpu) -> Result<RefitCounts, GpuError> {
        self.light_path.counts(gpu)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(text: &str) -> FramePlan {
        let scene = format!(
            "[body]\nshape = \"slab\"\nextent_m = [0.1, 0.1, 0.1]\n[[light]]\ntoward = [0.0, 1.0, 0.0]\n\
             irradiance_w_m2 = [1.0, 1.0, 1.0]\n{text}"
        );
        FramePlan::for_scene(&toml::from_str(&scene).expect("a sound scene"))
    }

    fn names(plan: &FramePlan) -> Vec<&'static str> {
        plan.passes.iter().map(|(name, _)| *name).collect()
    }

    #[test]
    fn a_plain_scene_without_shadow_records_three_passes() {
        let plan = plan("[surface]\nkind = \"plain\"");
        assert_eq!(names(&plan), ["tangents", "geometry", "plain"]);
        assert!(plan.left_out.contains(&"planes-incremental"));
    }

    #[test]
    fn only_a_marched_surface_has_planes() {
        let method = "[light_path]\nmethod = \"full\"\n";
        let marched = plan(&format!("{method}[surface]\nkind = \"subsurface\""));
        assert_eq!(
            names(&marched),
            ["tangents", "planes-full", "geometry", "subsurface"]
        );
        let gooey = plan(&format!(
            "{method}[surface]\nkind = \"gooey\"\nblur_passes = 3"
        ));
        assert_eq!(
            names(&gooey),
            ["tangents", "lightmap", "blur", "geometry", "gooey"]
        );
        let by_depth = |shadow: &str| {
            plan(&format!(
                "shadow = {shadow}\n[light_path]\nmethod = \"depth-map\"\n[surface]\nkind = \"subsurface\""
            ))
        };
        for shadow in ["false", "true"] {
            assert_eq!(
                names(&by_depth(shadow)),
                ["tangents", "depth-maps", "exit", "geometry", "subsurface"],
                "one map serves both"
            );
        }
        let green = |text: &str| plan(&format!("shadow = true\n[surface]\nkind = {text}"));
        assert_eq!(
            names(&green("\"wrap\"")),
            ["tangents", "shadow", "geometry", "wrap"]
        );
        let absorbing = green("\"absorption\"");
        assert_eq!(
            names(&absorbing),
            ["tangents", "body-depths", "geometry", "absorption"],
            "its first entries are the shadow map"
        );
        assert_eq!(absorbing.count_of("body-depths"), 1);
        let two = green("\"absorption\"\nabsorption = { depth_layers = 2 }");
        assert_eq!(two.count_of("body-depths"), 3);
        let diffusing = green("\"diffusion\"");
        assert_eq!(
            names(&diffusing),
            [
                "tangents",
                "shadow",
                "diffusion-map",
                "diffuse",
                "geometry",
                "diffusion"
            ]
        );
        assert_eq!(diffusing.count_of("diffuse"), 4);
        let both = green("\"diffusion\"\ndiffusion = { core = \"map\", translucency = 1.0 }");
        assert_eq!(both.count_of("diffuse"), 6);
        assert_eq!(both.count_of("body-depths"), 1);
        assert_eq!(both.count_of("shadow"), 0);
        assert_eq!(gooey.count_of("blur"), 3);
        assert_eq!(gooey.count_of("planes-full"), 0);
    }
}
