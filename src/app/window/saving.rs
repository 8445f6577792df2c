//! What the window writes: recordings, scenes and pictures.

use super::Shown;
use super::shown::Drag;
use crate::app::AppError;
use crate::app::take::Take;
use crate::measure::files::write;
use crate::measure::write_png;
use crate::scene::Scene;
use std::path::{Path, PathBuf};

/// The first of `stem-001.ending`, `stem-002.ending` … that is not there yet.
fn unused_name(stem: &str, ending: &str) -> PathBuf {
    (1_u32..)
        .map(|number| PathBuf::from(format!("{stem}-{number:03}.{ending}")))
        .find(|path| !path.exists())
        .expect("a folder has a bound on its files")
}

impl Shown {
    /// A take that is under way goes on from rest.
    pub fn begin_take_again(&mut self) {
        if let Some(take) = &mut self.take {
            *take = Take::default();
        }
    }

    /// Starts a take from rest, or ends one and saves it.
    pub fn record_or_stop(&mut self) {
        match self.take.take() {
            None => {
                self.hand = None;
                self.drag = Drag::Nothing;
                self.reset();
                self.take = Some(Take::default());
                self.state.paused = false;
                self.state.message = "recording from rest".to_owned();
            }
            Some(take) => self.save_take(&take),
        }
        self.state.records = self.take.is_some();
    }

    /// Ends and saves a take that is under way: what is recorded is not lost with the window or the scene. Whether there
    /// was one.
    pub fn end_take(&mut self) -> bool {
        let take = self.take.take();
        if let Some(take) = &take {
            self.save_take(take);
            self.state.records = false;
        }
        take.is_some()
    }

    /// What was done last, or went wrong in doing it.
    pub fn last_said(&self) -> &str {
        let state = &self.state;
        state.error.as_deref().unwrap_or(&state.message)
    }

    fn save_take(&mut self, take: &Take) {
        if take.is_empty() {
            self.state.message = "nothing was recorded".to_owned();
            return;
        }
        let about = format!(
            "# Recorded by hand in palpate's window. Its replay ends in the state\n# {}\n\n",
            self.session.state_sha256()
        );
        self.save(&take.scene(&self.session), &about);
    }

    /// Saves the scene as it is now, with the knobs as they were turned and the camera where it was moved to.
    pub fn save_scene(&mut self) {
        let mut scene = self.session.scene.clone();
        if self.camera_moved {
            let [width, height] = self.renderer.size();
            scene.camera = self.orbit.section(width as f32 / height as f32);
        }
        self.save(&scene, "");
    }

    /// Saves a scene below the comment `about`.
    fn save(&mut self, scene: &Scene, about: &str) {
        let path = unused_name("palpate", "toml");
        let saved = scene.to_toml().map_err(AppError::from);
        let saved = saved.and_then(|text| Ok(write(&path, (about.to_owned() + &text).as_bytes())?));
        match saved {
            Ok(()) => self.state.message = format!("saved {}", path.display()),
            Err(error) => self.state.error = Some(error.to_string()),
        }
    }

    pub fn screenshot(&mut self) -> Result<(), AppError> {
        let path = unused_name("palpate", "png");
        match write_png(&path, &self.renderer.picture()?) {
            Ok(()) => self.state.message = format!("saved {}", path.display()),
            Err(error) => self.state.error = Some(error.to_string()),
        }
        Ok(())
    }

    /// Writes the frame log of the session, if it was asked for.
    ///
    /// # Errors
    ///
    /// [`AppError::File`] naming the file and the remedy.
    pub fn write_log(&self, file: &Path) -> Result<(), AppError> {
        match &self.recording {
            Some(recording) => recording.write_log(file),
            None => Ok(()),
        }
    }
}
