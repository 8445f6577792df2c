//! Bodies that were simulated once, drawn with any surface.

use super::list::{Row, Variant};
use glam::Vec3;
use image::{DynamicImage, ImageFormat, RgbaImage};
use palpate::app::{Renderer, Session, load_scene};
use palpate::geom::import::read_file;
use palpate::gpu::Gpu;
use palpate::measure::files::{create_folder, write};
use palpate::passes::tools::DrawnTool;
use palpate::scene::Scene;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::OnceLock;

/// Threads of the simulation.
const THREADS: usize = 2;

/// A finished picture, and the light in it.
pub struct Shot {
    pub picture: RgbaImage,
    /// Linear, RGB.
    pub radiance: Vec<f32>,
    /// Where the body is.
    pub covered: Vec<bool>,
    width: usize,
}

/// A body at one frame.
struct Moment {
    points: Vec<Vec3>,
    volumes: Option<Vec<f32>>,
    tools: Vec<DrawnTool>,
}

/// A body, and the passes that drew it first.
struct Set {
    session: Session,
    renderer: Renderer,
    moments: Vec<(u32, Moment)>,
}

/// Draws pictures of one size.
pub struct Studio {
    gpu: Gpu,
    size: [u32; 2],
    sets: HashMap<String, Set>,
    /// Pictures that were drawn: techniques share what is off.
    shots: HashMap<String, Rc<Shot>>,
    /// Each layer of the liver in two, as two textures.
    split: [PathBuf; 2],
}

impl Shot {
    /// Mean step between neighbouring pixels of the body, over its mean light.
    pub fn contrast(&self) -> f64 {
        let light = |i: usize| -> f64 {
            self.radiance[3 * i..3 * i + 3]
                .iter()
                .map(|&x| f64::from(x))
                .sum()
        };
        let (mut steps, mut sum) = (0.0, 0.0);
        for i in 0..self.covered.len() - self.width {
            let beside = [i + 1, i + self.width];
            if self.covered[i] && beside.iter().all(|&j| self.covered[j]) {
                steps += beside
                    .iter()
                    .map(|&j| (light(i) - light(j)).abs())
                    .sum::<f64>();
                sum += light(i);
            }
        }
        steps / sum
    }
}

impl Studio {
    pub fn new(size: [u32; 2]) -> Self {
        Self {
            gpu: Gpu::headless().expect("a GPU adapter; a software one will do"),
            size,
            sets: HashMap::new(),
            shots: HashMap::new(),
            split: split_layers().clone(),
        }
    }

    /// The body of `row` at its first or second frame, drawn as `variant` has it.
    pub fn shot(
        &mut self,
        row: &Row,
        variant: &Variant,
        moment: usize,
        with_tools: bool,
    ) -> Rc<Shot> {
        let (upper, lower) = (self.split[0].display(), self.split[1].display());
        let sets: Vec<String> = (row.both.iter().chain(&variant.set))
            .map(|set| set.replace("{upper}", &upper.to_string()))
            .map(|set| set.replace("{lower}", &lower.to_string()))
            .collect();
        let frame = row.at[moment];
        let key = format!("{} {frame} {with_tools} {sets:?}", row.scene);
        if let Some(shot) = self.shots.get(&key) {
            return shot.clone();
        }
        let scene = load_scene(&row.scene, &sets).unwrap_or_else(|e| panic!("{}: {e}", row.what));
        let shot = Rc::new(self.draw(scene, row, frame, with_tools));
        self.shots.insert(key, shot.clone());
        shot
    }

    fn draw(&mut self, scene: Scene, row: &Row, frame: u32, with_tools: bool) -> Shot {
        let set = self.sets.entry(motion_of(&scene)).or_insert_with(|| {
            let session = Session::new(scene.clone(), THREADS).expect("a body");
            let renderer = Renderer::new(self.gpu.clone(), &session, self.size).expect("passes");
            Set {
                session,
                renderer,
                moments: Vec::new(),
            }
        });
        let at = match set.moments.iter().position(|(known, _)| *known == frame) {
            Some(at) => at,
            None => {
                assert!(
                    frame >= set.session.frame(),
                    "{}: frames go forwards",
                    row.what
                );
                while set.session.frame() < frame {
                    set.session.tick();
                }
                set.moments.push((frame, Moment::of(&set.session)));
                set.moments.len() - 1
            }
        };
        let other_maps = scene.body.maps != set.session.scene.body.maps;
        let was = std::mem::replace(&mut set.session.scene, scene);
        let mut renderer = if other_maps {
            Renderer::new(self.gpu.clone(), &set.session, self.size)
        } else {
            set.renderer.rebuilt(&set.session)
        }
        .expect("passes");
        let orbit = renderer.scene_orbit(&set.session);
        set.session.scene = was;
        let moment = &set.moments[at].1;
        let tools = if with_tools { &moment.tools[..] } else { &[] };
        renderer
            .draw(&moment.points, moment.volumes.as_deref(), &orbit, tools)
            .expect("a picture");
        Shot {
            picture: renderer.picture().expect("a picture"),
            radiance: renderer.radiance().expect("its light"),
            covered: renderer
                .depth()
                .expect("its depth")
                .iter()
                .map(|&z| z < 1.0)
                .collect(),
            width: self.size[0] as usize,
        }
    }
}

impl Moment {
    fn of(session: &Session) -> Self {
        Self {
            points: session.points().to_vec(),
            volumes: session.simulation().point_volumes().map(<[f32]>::to_vec),
            tools: session.visible_tools(),
        }
    }
}

/// All of a scene that decides how its body moves.
fn motion_of(scene: &Scene) -> String {
    let mut body = scene.body.clone();
    body.maps = None;
    format!("{body:?} {:?} {:?}", scene.solver, scene.tools)
}

/// The layers of the liver, each cut into two, as textures of four each.
fn split_layers() -> &'static [PathBuf; 2] {
    // Once: tests that run side by side would write the same files.
    static FILES: OnceLock<[PathBuf; 2]> = OnceLock::new();
    FILES.get_or_init(written_layers)
}

fn written_layers() -> [PathBuf; 2] {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bytes = read_file(&manifest.join("scenes/textures/liver-layers.png")).expect("a texture");
    let layers: DynamicImage = image::load_from_memory(&bytes).expect("a picture");
    let layers = layers.into_rgba8();
    let (mut upper, mut lower) = (layers.clone(), layers.clone());
    for (x, y, pixel) in layers.enumerate_pixels() {
        let [a, b, c, d] = pixel.0;
        let middle = |low: u8, high: u8| low + high.saturating_sub(low) / 2;
        upper.get_pixel_mut(x, y).0 = [a / 2, a, middle(a, b), b];
        lower.get_pixel_mut(x, y).0 = [middle(b, c), c, middle(c, d), d];
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gallery");
    create_folder(&folder).expect("a folder");
    [("upper.png", upper), ("lower.png", lower)].map(|(name, picture)| {
        let file = folder.join(name);
        let mut png = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut png, ImageFormat::Png).expect("a PNG");
        write(&file, png.get_ref()).expect("written");
        file
    })
}
