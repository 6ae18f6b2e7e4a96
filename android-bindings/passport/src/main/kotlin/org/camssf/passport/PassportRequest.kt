package org.camssf.passport

import java.util.Collections
import kotlin.time.Instant

/**
 * What the one who signs says beside the result.
 *
 * @property unit whose curves these are; what the photos and the result say may be left to them.
 * @property captured when the photo was taken, ISO 8601; "" leaves it to the photos.
 * @property chartSerial of the chart; "" where nobody said.
 * @property days how long it is valid.
 * @property begins from when on; now if null.
 */
public class PassportRequest @JvmOverloads constructor(
    public val unit: CameraUnit = CameraUnit(),
    public val captured: String = "",
    public val chartSerial: String = "",
    lampSerials: List<String> = emptyList(),
    public val days: Double = 365.0,
    public val begins: Instant? = null,
) {
    /** Of each shot's lamp, in their order; none at all, or one a shot. */
    public val lampSerials: List<String> = Collections.unmodifiableList(ArrayList(lampSerials))
}
