//! A scene or a body that is being opened, on a thread of its own, while the old scene goes on.

use crate::app::renderer::Renderer;
use crate::app::{AppError, Session, load};
use crate::gpu::Gpu;
use crate::scene::Scene;
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// What was asked to be opened.
#[derive(Clone, Debug, PartialEq)]
pub enum Wanted {
    /// A bundled scene, or a scene file.
    Scene(String),
    /// A surface or tetrahedra, in place of the body of the running scene.
    Body(Box<Scene>, String),
    /// The running scene with what was changed in it.
    Changed(Box<Scene>),
}

impl Wanted {
    /// Decides by the ending of `path`; a name without one is a bundled scene. A body takes the place of that in `running`.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] for a file of another kind.
    pub fn of(path: &str, running: &Scene) -> Result<Self, AppError> {
        let ending = Path::new(path).extension().and_then(|e| e.to_str());
        match ending.map(str::to_ascii_lowercase).as_deref() {
            None | Some("toml") => Ok(Self::Scene(path.to_owned())),
            Some("glb" | "gltf" | "obj" | "msh") => {
                Ok(Self::Body(Box::new(running.clone()), path.to_owned()))
            }
            Some(_) => Err(AppError::Usage(format!(
                "{path} can't be opened: give a scene (.toml), a surface (.glb, .gltf, .obj) or tetrahedra (.msh)"
            ))),
        }
    }

    /// What is opened, in words.
    pub fn name(&self) -> &str {
        match self {
            Self::Scene(name) | Self::Body(_, name) => name,
            Self::Changed(_) => "the changed body",
        }
    }

    /// The scene that is meant.
    fn scene(&self) -> Result<Scene, AppError> {
        match self {
            Self::Scene(name) => load::scene(name, &[]),
            Self::Body(running, file) => {
                if !Path::new(file).is_file() {
                    return Err(AppError::Usage(format!("{file} is no file")));
                }
                let file = toml::Value::String(file.clone());
                Ok(running.with(&[format!("body.file={file}")])?)
            }
            Self::Changed(scene) => Ok(scene.with(&[])?),
        }
    }
}

/// A session with the passes that draw it.
pub struct Opened {
    /// What was wanted; nothing where the running scene was changed.
    pub name: Option<String>,
    /// The body and its script, at rest.
    pub session: Session,
    /// Its passes.
    pub renderer: Renderer,
}

/// One that is under way.
pub struct Opening {
    name: String,
    arrival: Receiver<Result<Opened, String>>,
    arrived: Option<Result<Opened, String>>,
}

impl Opening {
    /// Begins to open `wanted`, for pictures of `size` [px].
    pub fn begin(wanted: Wanted, gpu: Gpu, size: [u32; 2], threads: usize) -> Self {
        let name = wanted.name().to_owned();
        let (send, arrival) = channel();
        std::thread::spawn(move || {
            let opened = open(&wanted, gpu, size, threads).map_err(|e| e.to_string());
            // Nobody waits for it any more when something else is being opened.
            let _ = send.send(opened);
        });
        Self {
            name,
            arrival,
            arrived: None,
        }
    }

    /// What is being opened.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it has come in.
    pub fn has_arrived(&mut self) -> bool {
        if self.arrived.is_none() {
            self.arrived = match self.arrival.try_recv() {
                Ok(opened) => Some(opened),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => Some(Err(format!(
                    "{} can't be opened: reading it broke off",
                    self.name
                ))),
            };
        }
        self.arrived.is_some()
    }

    /// Takes what has come in, or says why nothing will.
    pub fn take(&mut self) -> Option<Result<Opened, String>> {
        self.has_arrived();
        self.arrived.take()
    }
}

fn open(wanted: &Wanted, gpu: Gpu, size: [u32; 2], threads: usize) -> Result<Opened, AppError> {
    let mut session = Session::new(wanted.scene()?, threads)?;
    session.script_plays = false;
    let renderer = Renderer::new(gpu, &session, size)?;
    let name = match wanted {
        Wanted::Changed(_) => None,
        _ => Some(wanted.name().to_owned()),
    };
    Ok(Opened {
        name,
        session,
        renderer,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn running() -> Scene {
        load::scene("liver", &[]).expect("a bundled scene")
    }

    #[test]
    fn a_scene_opens_by_name_or_file_and_a_body_takes_the_place_of_the_running_one() {
        let scene = running();
        let of = |path: &str| Wanted::of(path, &scene);
        assert_eq!(of("heart").unwrap(), Wanted::Scene("heart".to_owned()));
        assert!(matches!(of("my/Scene.TOML").unwrap(), Wanted::Scene(_)));
        for body in ["spleen.glb", "a.gltf", "b.OBJ", "c.msh"] {
            assert!(matches!(of(body).unwrap(), Wanted::Body(..)), "{body}");
        }
        let told = of("notes.txt").unwrap_err().to_string();
        assert!(
            told.contains("notes.txt") && told.contains(".msh"),
            "{told}"
        );
    }

    #[test]
    fn a_body_keeps_the_scene_and_loses_the_maps_that_were_painted_for_another() {
        let folder = std::env::temp_dir().join(format!("palpate-opening-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let file = folder.join("it's \"one\".obj");
        std::fs::write(&file, "").expect("a file");
        let mut scene = running();
        scene.solver.youngs_modulus_pa = 1234.0;
        let wanted = Wanted::of(file.to_str().unwrap(), &scene).unwrap();
        let opened = wanted.scene().expect("the scene is sound");
        std::fs::remove_dir_all(&folder).expect("it was made");
        assert_eq!(opened.body.file.as_deref(), Some(file.as_path()));
        assert_eq!(opened.body.maps, None);
        assert_eq!(opened.solver, scene.solver);
        assert_eq!(opened.tools, scene.tools);
    }
}
