package org.camssf.photo.dng

/** The tags that the reader uses: TIFF 6.0; Exif 2.3; Digital Negative (DNG) Specification 1.7, Adobe. */
internal object Tag {
    const val NEW_SUBFILE_TYPE = 254
    const val WIDTH = 256
    const val HEIGHT = 257
    const val BITS = 258
    const val COMPRESSION = 259
    const val PHOTOMETRIC = 262
    const val FILL_ORDER = 266
    const val MAKE = 271
    const val MODEL = 272
    const val STRIP_OFFSETS = 273
    const val ORIENTATION = 274
    const val SAMPLES = 277
    const val ROWS_PER_STRIP = 278
    const val STRIP_COUNTS = 279
    const val PREDICTOR = 317
    const val TILE_WIDTH = 322
    const val TILE_HEIGHT = 323
    const val TILE_OFFSETS = 324
    const val TILE_COUNTS = 325
    const val SUB_IFDS = 330
    const val SAMPLE_FORMAT = 339
    const val CFA_SIZE = 33421
    const val CFA_PATTERN = 33422
    const val EXPOSURE = 33434
    const val F_NUMBER = 33437
    const val EXIF = 34665
    const val ISO = 34855
    const val TIME = 36867
    const val TIME_OFFSET = 36881
    const val FOCAL_LENGTH = 37386
    const val BODY_SERIAL = 42033
    const val LENS_MODEL = 42036
    const val DNG_VERSION = 50706
    const val UNIQUE_MODEL = 50708
    const val CFA_PLANES = 50710
    const val CFA_LAYOUT = 50711
    const val LINEARIZATION = 50712
    const val BLACK_REPEAT = 50713
    const val BLACK = 50714
    const val BLACK_ACROSS = 50715
    const val BLACK_DOWN = 50716
    const val WHITE = 50717
    const val COLOR_MATRIX_1 = 50721
    const val COLOR_MATRIX_2 = 50722
    const val CALIBRATION_1 = 50723
    const val CALIBRATION_2 = 50724
    const val ANALOG_BALANCE = 50727
    const val NEUTRAL = 50728
    const val WHITE_XY = 50729
    const val CAMERA_SERIAL = 50735
    const val ILLUMINANT_1 = 50778
    const val ILLUMINANT_2 = 50779
    const val ACTIVE_AREA = 50829
    const val MASKED_AREAS = 50830
    const val OPCODES_1 = 51008
    const val OPCODES_2 = 51009
    const val OPCODES_3 = 51022
    const val NOISE_PROFILE = 51041

    /** All of the above; no other tag of a directory is kept. */
    val KNOWN: Set<Int> = hashSetOf(
        NEW_SUBFILE_TYPE, WIDTH, HEIGHT, BITS, COMPRESSION, PHOTOMETRIC, FILL_ORDER, MAKE, MODEL, STRIP_OFFSETS,
        ORIENTATION, SAMPLES, ROWS_PER_STRIP, STRIP_COUNTS, PREDICTOR, TILE_WIDTH, TILE_HEIGHT, TILE_OFFSETS,
        TILE_COUNTS, SUB_IFDS, SAMPLE_FORMAT, CFA_SIZE, CFA_PATTERN, EXPOSURE, EXIF, ISO, DNG_VERSION, UNIQUE_MODEL,
        CFA_PLANES, CFA_LAYOUT, LINEARIZATION, BLACK_REPEAT, BLACK, BLACK_ACROSS, BLACK_DOWN, WHITE, COLOR_MATRIX_1,
        COLOR_MATRIX_2, CALIBRATION_1, CALIBRATION_2, ANALOG_BALANCE, ILLUMINANT_1, ILLUMINANT_2,
        NEUTRAL, WHITE_XY, ACTIVE_AREA, MASKED_AREAS, OPCODES_1, OPCODES_2, OPCODES_3, NOISE_PROFILE,
        F_NUMBER, FOCAL_LENGTH, BODY_SERIAL, LENS_MODEL, CAMERA_SERIAL,
        TIME, TIME_OFFSET,
    )
}
