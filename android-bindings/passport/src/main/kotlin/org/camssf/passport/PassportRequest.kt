package org.camssf.passport

import java.util.Collections
import kotlin.time.Instant

/**
 * What the signer states in addition to the result.
 *
 * @property unit the camera unit; empty fields are taken from the photos and the result.
 * @property captured when the photo was taken, ISO 8601; "" to take it from the photos.
 * @property chartSerial serial number of the chart; "" if unknown.
 * @property days validity period.
 * @property begins start of validity; null for now.
 */
public class PassportRequest @JvmOverloads constructor(
    public val unit: CameraUnit = CameraUnit(),
    public val captured: String = "",
    public val chartSerial: String = "",
    lampSerials: List<String> = emptyList(),
    public val days: Double = 365.0,
    public val begins: Instant? = null,
) {
    /** Serial number of each shot's lamp, in order; empty, or one entry per shot. */
    public val lampSerials: List<String> = Collections.unmodifiableList(ArrayList(lampSerials))

    override fun toString(): String = "PassportRequest($unit, captured=$captured, chartSerial=$chartSerial, " +
        "lampSerials=$lampSerials, days=$days, begins=$begins)"
}
