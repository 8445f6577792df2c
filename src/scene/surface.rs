//! `[surface]`: the one surface model of a scene, its layers and its knobs.

use super::check::Checker;
use super::gooey::{INNER_MAX, InnerLight, InnerSection, InnerTaps, Noise};
use super::green::{AbsorptionSection, DiffusionSection, LookupSection};
use crate::optics::{LAYERS_MAX, Layer, OpticalTissue};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// How the surface is drawn.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceSection {
    /// Which model.
    pub kind: SurfaceKind,
    /// `subsurface`: places along the view ray where light is gathered; by layer, rounded up to as many in
    /// each layer.
    pub samples: u32,
    /// `subsurface`: how the light between them is summed.
    pub quadrature: Quadrature,
    /// `subsurface`: depth that the value 1 of the layer texture stands for [m].
    pub layer_depth_max_m: f32,
    /// A tissue by name, whose measured coefficients fill the layers. Layers that the scene gives itself win.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tissue: Option<OpticalTissue>,
    /// `subsurface`: one to eight layers, outermost first; the last goes on below its boundary.
    #[serde(rename = "layer")]
    pub layers: Vec<LayerSection>,
    /// `subsurface`: how far the colour textures tint the layers (Norberg 2010, 5.1), 0 to 1.
    pub color_blend: f32,
    /// `subsurface`: where light that scattered more than once comes from.
    pub multiple: Multiple,
    /// `subsurface`: strength of that light.
    pub multiple_scattering: f32,
    /// How far wrapped light reaches round the terminator, 0 to 1.
    pub wrap: f32,
    /// `subsurface`: what moves the places where the march reads the layers, against bands (Norberg 2010, 3.1.2).
    pub noise: Noise,
    /// `subsurface`: how far it moves them along the surface [m], 0 to 0.1.
    pub noise_m: f32,
    /// `subsurface`: look-ups of `clouds`, each at the place that the one before tells, 1 to 8.
    pub noise_lookups: u32,
    /// `gooey`: distance between the outer layer and the first inner one [m]; inner layers say theirs as multiples of it.
    pub layer_distance_m: f32,
    /// `gooey`: one to four inner layers, outermost first; the last one is opaque.
    pub inner: Vec<InnerSection>,
    /// `gooey`: how the colour of inner layers is blurred.
    pub inner_taps: InnerTaps,
    /// `gooey`: radius of that blur, as a share of the way from the surface to the layer, 0 to 4.
    pub inner_blur: f32,
    /// `gooey`: what lights the inner layers.
    pub inner_light: InnerLight,
    /// `gooey`: share of the light that an opaque layer keeps from those below it, 0 to 1.
    pub layer_shadow: f32,
    /// `gooey`: radius of the disc that the light of inner layers is blurred by [m].
    pub blur_radius_m: f32,
    /// `gooey`: times that it is blurred.
    pub blur_passes: u32,
    /// `gooey`: multiplies the opacity of the outer layer.
    pub outer_opacity: f32,
    /// `gooey`, `diffusion`: side of the light map [px]; left out, 256, and for `gooey` no more than its blur asks for.
    pub light_map_size_px: Option<u32>,
    /// How texture coordinates below the surface follow it as it stretches.
    pub uv_metric: UvMetric,
    /// Whether layers thin where the surface stretches, as tissue does that keeps its volume.
    pub thickness_follows_volume: bool,
    /// Strength of the normal map.
    pub relief: f32,
    /// Roughness of the wet film: 0 a mirror, 1 dull.
    pub roughness: f32,
    /// Strength of reflections on the wet film.
    pub wetness: f32,
    /// Multiplies the light of the room that falls on the tissue; what the film mirrors stays.
    pub room_light: f32,
    /// Multiplies radiance before the tone curve.
    pub exposure: f32,
    /// `wrap` and `absorption`: the table of wrapped light.
    pub lookup: LookupSection,
    /// `absorption`, and `diffusion` where it asks: light that comes through the body.
    pub absorption: AbsorptionSection,
    /// `diffusion`: how far light wanders.
    pub diffusion: DiffusionSection,
}

/// The surface models.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceKind {
    /// Lit, no scattering.
    Plain,
    /// Single scattering in layers: François 2006, Norberg 2010.
    #[default]
    Subsurface,
    /// Two layers with parallax and a blurred light map: Oat 2006.
    Gooey,
    /// Light wrapped round the terminator, from a table: Green 2004, 16.2.
    Wrap,
    /// Wrapped light, and light that comes through the body: Green 2004, 16.3.
    Absorption,
    /// Light diffused in texture space: Green 2004, 16.4.
    Diffusion,
}

impl SurfaceKind {
    /// Name in scene files, logs and charts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Subsurface => "subsurface",
            Self::Gooey => "gooey",
            Self::Wrap => "wrap",
            Self::Absorption => "absorption",
            Self::Diffusion => "diffusion",
        }
    }

    /// Whether the model looks below the surface, by planes and gradients.
    pub fn looks_below(self) -> bool {
        matches!(self, Self::Subsurface | Self::Gooey)
    }
}

/// How a step below the surface becomes one of texture coordinates.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum UvMetric {
    /// By the metric of the deformed surface: layers keep their depth when tissue stretches.
    #[default]
    Deformed,
    /// By unit tangents, as in the sources: right at rest only.
    Unit,
}

impl UvMetric {
    /// Name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Deformed => "deformed",
            Self::Unit => "unit",
        }
    }
}

/// How light along the view ray is summed.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Quadrature {
    /// Equal steps, each valued at its start (François 2006, Algorithm 1).
    Published,
    /// Steps that grow with depth, each integrated in closed form over the layers in it.
    ClosedForm,
    /// As many samples in each layer, the last at its end, and the closed form between them.
    #[default]
    ByLayer,
}

/// Light that scattered more than once.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Multiple {
    /// The colour of the maps, lit round the terminator.
    #[default]
    Wrapped,
    /// From the coefficients of the layers, in closed form; from the maps only what the room lights.
    Calibrated,
}

/// One layer of tissue.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct LayerSection {
    /// Absorption σ_a [1/m], red, green, blue.
    pub absorption_per_m: [f32; 3],
    /// Scattering σ_s [1/m].
    pub scattering_per_m: [f32; 3],
    /// Schlick's k, which the papers call g: above 0 light is scattered forwards.
    pub asymmetry: f32,
}

impl From<LayerSection> for Layer {
    fn from(section: LayerSection) -> Self {
        Self {
            absorption_per_m: Vec3::from_array(section.absorption_per_m),
            scattering_per_m: Vec3::from_array(section.scattering_per_m),
            asymmetry: section.asymmetry,
        }
    }
}

impl From<Layer> for LayerSection {
    fn from(layer: Layer) -> Self {
        Self {
            absorption_per_m: layer.absorption_per_m.to_array(),
            scattering_per_m: layer.scattering_per_m.to_array(),
            asymmetry: layer.asymmetry,
        }
    }
}

impl Default for SurfaceSection {
    fn default() -> Self {
        let layer = |absorption_per_m, scattering_per_m, asymmetry| LayerSection {
            absorption_per_m,
            scattering_per_m,
            asymmetry,
        };
        Self {
            kind: SurfaceKind::default(),
            samples: 4,
            quadrature: Quadrature::default(),
            layer_depth_max_m: 0.006,
            tissue: None,
            // Ratios between the colours as published for blood-rich tissue; all of it about six
            // times clearer, so that what lies below shows at the distance of a whole organ.
            layers: vec![
                layer([15.0, 30.0, 35.0], [120.0, 130.0, 140.0], 0.3),
                layer([60.0, 800.0, 1000.0], [250.0, 270.0, 290.0], 0.4),
                layer([180.0, 1700.0, 1500.0], [140.0, 120.0, 160.0], 0.5),
                layer([75.0, 1000.0, 1250.0], [250.0, 270.0, 290.0], 0.4),
            ],
            color_blend: 0.7,
            multiple: Multiple::default(),
            multiple_scattering: 1.0,
            wrap: 0.35,
            noise: Noise::default(),
            noise_m: 0.001,
            noise_lookups: 3,
            layer_distance_m: 0.0015,
            inner: vec![InnerSection::default()],
            inner_taps: InnerTaps::default(),
            inner_blur: 0.5,
            inner_light: InnerLight::default(),
            layer_shadow: 0.0,
            blur_radius_m: 0.004,
            blur_passes: 2,
            outer_opacity: 1.0,
            light_map_size_px: None,
            uv_metric: UvMetric::default(),
            thickness_follows_volume: false,
            relief: 1.0,
            roughness: 0.24,
            wetness: 1.0,
            room_light: 1.0,
            exposure: 1.0,
            lookup: LookupSection::default(),
            absorption: AbsorptionSection::default(),
            diffusion: DiffusionSection::default(),
        }
    }
}

impl SurfaceSection {
    /// Fills the layers with those of the tissue that is named; nothing if none is.
    pub fn take_tissue(&mut self) {
        if let Some(tissue) = self.tissue {
            self.layers = tissue.layers().map(LayerSection::from).to_vec();
        }
    }

    /// Whether light that comes through the body is drawn, so that depth maps are needed.
    pub fn is_translucent(&self) -> bool {
        match self.kind {
            SurfaceKind::Absorption => true,
            SurfaceKind::Diffusion => self.diffusion.translucency > 0.0,
            _ => false,
        }
    }

    /// Whether a light map is drawn for inner layers.
    pub fn has_light_map(&self) -> bool {
        self.kind == SurfaceKind::Gooey && self.inner_light == InnerLight::Map
    }

    /// Extinction σ_t [1/m] that bounds how far light wanders: of the densest layer, in the colour that
    /// reaches farthest there. The outermost one is a clear skin that light crosses in a moment.
    pub fn bounding_extinction_per_m(&self) -> f32 {
        let clearest = |layer: &LayerSection| {
            (0..3)
                .map(|c| layer.absorption_per_m[c] + layer.scattering_per_m[c])
                .fold(f32::INFINITY, f32::min)
        };
        self.layers.iter().map(clearest).fold(0.0, f32::max)
    }

    /// The layers as shaders take them: the last one is repeated below.
    pub fn repeated_layers(&self) -> [Layer; LAYERS_MAX] {
        std::array::from_fn(|j| self.layers[j.min(self.layers.len() - 1)].into())
    }

    pub(super) fn check(&self, c: &mut Checker) {
        if !(1..=LAYERS_MAX).contains(&self.layers.len()) {
            c.problem(
                "surface.layer",
                &format!(
                    "there are {}; 1 to {LAYERS_MAX} are allowed",
                    self.layers.len()
                ),
            );
        }
        c.range("surface.samples", self.samples as f32, 1.0, 256.0);
        c.range(
            "surface.layer_depth_max_m",
            self.layer_depth_max_m,
            1e-6,
            1.0,
        );
        for (index, layer) in self.layers.iter().enumerate() {
            let key = |name: &str| format!("surface.layer.{index}.{name}");
            if self.multiple == Multiple::Calibrated && layer.asymmetry < 0.0 {
                c.problem(
                    &key("asymmetry"),
                    "it is below 0: light that is scattered backwards has no closed form here; set it to 0 or more, or \
                     surface.multiple to \"wrapped\"",
                );
            }
            c.range3(&key("absorption_per_m"), layer.absorption_per_m, 0.0, 1e6);
            c.range3(&key("scattering_per_m"), layer.scattering_per_m, 0.0, 1e6);
            c.range(&key("asymmetry"), layer.asymmetry, -0.98, 0.98);
            let clear =
                (0..3).any(|i| layer.absorption_per_m[i] + layer.scattering_per_m[i] < 1e-3);
            if clear {
                c.problem(
                    &key("scattering_per_m"),
                    "absorption + scattering must be at least 0.001",
                );
            }
        }
        for (name, value, high) in [
            ("color_blend", self.color_blend, 1.0),
            ("multiple_scattering", self.multiple_scattering, 10.0),
            ("wrap", self.wrap, 1.0),
            ("layer_distance_m", self.layer_distance_m, 1.0),
            ("inner_blur", self.inner_blur, 4.0),
            ("layer_shadow", self.layer_shadow, 1.0),
            ("noise_m", self.noise_m, 0.1),
            ("blur_radius_m", self.blur_radius_m, 1.0),
            ("blur_passes", self.blur_passes as f32, 8.0),
            ("outer_opacity", self.outer_opacity, 4.0),
            ("relief", self.relief, 4.0),
            ("wetness", self.wetness, 4.0),
            ("room_light", self.room_light, 10.0),
            ("exposure", self.exposure, 100.0),
        ] {
            c.range(&format!("surface.{name}"), value, 0.0, high);
        }
        c.range("surface.noise_lookups", self.noise_lookups as f32, 1.0, 8.0);
        if !(1..=INNER_MAX).contains(&self.inner.len()) {
            c.problem(
                "surface.inner",
                &format!(
                    "there are {}; 1 to {INNER_MAX} are allowed",
                    self.inner.len()
                ),
            );
        }
        for (index, layer) in self.inner.iter().enumerate() {
            let key = |name: &str| format!("surface.inner.{index}.{name}");
            c.range(&key("distance"), layer.distance, 0.0, 100.0);
            c.range(&key("opacity"), layer.opacity, 0.0, 1.0);
            c.range3(&key("color"), layer.color, 0.0, 4.0);
        }
        if self.thickness_follows_volume && self.uv_metric == UvMetric::Unit {
            c.problem(
                "surface.thickness_follows_volume",
                "it reads the area from the deformed metric: set surface.uv_metric to \"deformed\"",
            );
        }
        self.lookup.check(c);
        self.absorption.check(c);
        self.diffusion.check(c);
        c.range("surface.roughness", self.roughness, 0.02, 1.0);
        if let Some(size_px) = self.light_map_size_px {
            c.range("surface.light_map_size_px", size_px as f32, 32.0, 4096.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::optics::OpticalTissue;
    use crate::scene::{LayerSection, Scene, SceneSource};

    fn scene(surface: &str, sets: &[&str]) -> Result<Scene, String> {
        let text =
            format!("[body]\nshape = \"slab\"\nextent_m = [1.0, 1.0, 1.0]\n[surface]\n{surface}");
        let source = SceneSource {
            name: "test",
            text: &text,
            folder: None,
        };
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        Scene::read(&source, &sets).map_err(|error| error.to_string())
    }

    fn layers_of(tissue: OpticalTissue) -> Vec<LayerSection> {
        tissue.layers().map(LayerSection::from).to_vec()
    }

    #[test]
    fn a_named_tissue_fills_the_layers_unless_the_scene_gives_its_own() {
        let spleen = scene("tissue = \"spleen\"", &[]).expect("a scene");
        assert_eq!(spleen.surface.layers, layers_of(OpticalTissue::Spleen));
        let layer = "[[surface.layer]]\nabsorption_per_m = [1.0, 2.0, 3.0]\n\
                     scattering_per_m = [4.0, 5.0, 6.0]\nasymmetry = 0.1";
        let own = scene(&format!("tissue = \"spleen\"\n{layer}"), &[]).expect("a scene");
        assert_eq!(own.surface.layers.len(), 1);
        // What is told on the command line is told last.
        let told = scene(layer, &["surface.tissue=fat"]).expect("a scene");
        assert_eq!(told.surface.layers, layers_of(OpticalTissue::Fat));
        let saved = told.to_toml().expect("it has a TOML form");
        let text = saved.as_str();
        let source = SceneSource {
            name: "saved",
            text,
            folder: None,
        };
        assert_eq!(Scene::read(&source, &[]).expect("it reads back"), told);
    }

    #[test]
    fn an_unknown_tissue_is_answered_with_the_known_ones() {
        for told in [
            scene("tissue = \"tofu\"", &[]),
            scene("", &["surface.tissue=tofu"]),
        ] {
            let message = told.expect_err("there is no such tissue");
            assert!(message.contains("tofu"), "{message}");
            for tissue in OpticalTissue::ALL {
                assert!(message.contains(tissue.name()), "{message}");
            }
        }
    }

    #[test]
    fn light_scattered_backwards_has_no_calibrated_form() {
        let layer = "multiple = \"calibrated\"\n[[surface.layer]]\nabsorption_per_m = [1.0, 2.0, 3.0]\n\
                     scattering_per_m = [4.0, 5.0, 6.0]\nasymmetry = -0.1";
        let message = scene(layer, &[]).expect_err("it is refused");
        assert!(message.contains("surface.layer.0.asymmetry"), "{message}");
    }
}
