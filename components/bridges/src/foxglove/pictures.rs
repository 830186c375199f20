//! The pictures of cameras as messages of Foxglove.

use foxglove::messages::RawImage;
use motorium::plan::Plan;
use motorium::state::{ImageInfo, StateBuffer as _, from_bytes};

use super::fields::timestamp;

/// The pictures of a topic of slices of `u8`, in the form that their writer tells on another.
#[derive(Debug, Clone)]
pub(super) struct Pictures {
    form_topic: usize,
    form: Option<ImageInfo>,
    /// The frame of the camera: the name of its component.
    frame: String,
}

/// Bytes that cannot be drawn as a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// Their form was not told yet.
    #[error("the form of the pictures is not known yet")]
    NoForm,
    /// They do not have the form that was told.
    #[error("a picture of {found} bytes, of {width} x {height} pixels in encoding {encoding}")]
    Form {
        /// Bytes found.
        found: usize,
        /// Pixels of a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Form of a pixel, as of [`ImageInfo`].
        encoding: u32,
    },
}

impl Pictures {
    /// The pictures of a topic, if it carries bytes and its writer tells the form of one kind of pictures.
    pub(super) fn of_topic(plan: &Plan, index: usize) -> Option<Self> {
        let topic = plan.topics.get(index).filter(|topic| topic.layout.type_name == u8::NAME)?;
        let writer = plan.components.get(topic.writer)?;
        let of_type = |topic: &usize| {
            plan.topics.get(*topic).is_some_and(|topic| topic.layout.type_name == ImageInfo::NAME)
        };
        let mut forms = writer.outputs.iter().filter_map(|port| port.topic).filter(of_type);
        let form_topic = forms.next().filter(|_| forms.next().is_none())?;
        Some(Self { form_topic, form: None, frame: writer.name.clone() })
    }

    /// The topic that tells their form.
    pub(super) fn form_topic(&self) -> usize {
        self.form_topic
    }

    /// Takes note of their form.
    pub(super) fn note(&mut self, bytes: &[u8]) {
        self.form = from_bytes(bytes).or(self.form);
    }

    /// The message of a picture. One of a byte a pixel is grey, whatever the form says of those beside it.
    pub(super) fn image(&self, bytes: &[u8], time_ns: u64) -> Result<RawImage, PictureError> {
        let ImageInfo { width, height, stride, encoding, .. } = self.form.ok_or(PictureError::NoForm)?;
        let is_of = |stride: u32| u64::from(stride) * u64::from(height) == bytes.len() as u64;
        let (name, step) = match encoding {
            ImageInfo::RGB_8 if is_of(stride) => ("rgb8", stride),
            ImageInfo::BGR_8 if is_of(stride) => ("bgr8", stride),
            ImageInfo::DEPTH_32 if is_of(stride) => ("32FC1", stride),
            ImageInfo::GREY_8 if is_of(stride) => ("mono8", stride),
            ImageInfo::RGB_8 | ImageInfo::BGR_8 | ImageInfo::DEPTH_32 if is_of(width) => ("mono8", width),
            _ => return Err(PictureError::Form { found: bytes.len(), width, height, encoding }),
        };
        Ok(RawImage {
            timestamp: Some(timestamp(time_ns)),
            frame_id: self.frame.clone(),
            width,
            height,
            encoding: name.to_string(),
            step,
            data: bytes.to_vec().into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures(encoding: u32, stride: u32) -> Pictures {
        let form = ImageInfo { width: 4, height: 2, stride, encoding, ..ImageInfo::default() };
        Pictures { form_topic: 0, form: Some(form), frame: "eye".to_string() }
    }

    #[test]
    fn a_picture_has_the_encoding_of_its_form_and_grey_beside_depth_is_grey() {
        for (encoding, stride, bytes, name) in [
            (ImageInfo::RGB_8, 12, 24, "rgb8"),
            (ImageInfo::BGR_8, 16, 32, "bgr8"),
            (ImageInfo::GREY_8, 4, 8, "mono8"),
            (ImageInfo::DEPTH_32, 16, 32, "32FC1"),
            (ImageInfo::DEPTH_32, 16, 8, "mono8"),
        ] {
            let image = pictures(encoding, stride).image(&vec![7; bytes], 1_500_000_000).unwrap();
            assert_eq!((image.encoding.as_str(), image.step as usize * 2), (name, bytes));
            assert_eq!(
                (image.width, image.height, image.frame_id.as_str(), image.data.len()),
                (4, 2, "eye", bytes)
            );
            assert_eq!(image.timestamp.map(|time| (time.sec(), time.nsec())), Some((1, 500_000_000)));
        }
    }

    #[test]
    fn bytes_of_another_number_are_no_picture_and_neither_is_a_file() {
        let error = pictures(ImageInfo::RGB_8, 12).image(&[0; 23], 0).unwrap_err();
        assert!(error.to_string().contains("23 bytes"), "{error}");
        assert!(pictures(ImageInfo::JPEG, 0).image(&[0; 8], 0).is_err());
        let unknown = Pictures { form: None, ..pictures(ImageInfo::RGB_8, 12) };
        assert_eq!(unknown.image(&[0; 24], 0), Err(PictureError::NoForm));
    }
}
