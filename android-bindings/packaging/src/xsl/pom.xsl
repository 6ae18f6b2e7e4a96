<?xml version="1.0" encoding="UTF-8"?>
<!-- The POM as it is published, from the flattened one of the module. -->
<xsl:stylesheet version="1.0" xmlns:xsl="http://www.w3.org/1999/XSL/Transform"
                xmlns:m="http://maven.apache.org/POM/4.0.0" xmlns="http://maven.apache.org/POM/4.0.0"
                exclude-result-prefixes="m">
  <xsl:param name="onnxruntime" />
  <xsl:param name="camerax" />
  <xsl:output indent="yes" />
  <xsl:strip-space elements="*" />

  <xsl:template match="@*|node()">
    <xsl:copy>
      <xsl:apply-templates select="@*|node()" />
    </xsl:copy>
  </xsl:template>

  <!-- By this line, word for word, Gradle knows that a .module lies beside it. -->
  <xsl:template match="m:modelVersion">
    <xsl:comment> do_not_remove: published-with-gradle-metadata </xsl:comment>
    <xsl:copy-of select="." />
  </xsl:template>

  <!-- What only compiling here needs: Android's classes, the desktop's ONNX Runtime, stubs. -->
  <xsl:template match="m:dependency[m:scope = 'provided']" />

  <!-- camera2 is an AAR, and brings the phone's ONNX Runtime, which no registry of this build has. -->
  <xsl:template match="m:project[m:artifactId = 'camssf-camera2']/m:version">
    <xsl:copy-of select="." />
    <packaging>aar</packaging>
  </xsl:template>
  <xsl:template match="m:dependency[m:artifactId = 'camssf-camera2'][not(m:type)]/m:version">
    <xsl:copy-of select="." />
    <type>aar</type>
  </xsl:template>
  <xsl:template match="m:project[m:artifactId = 'camssf-camera2']/m:dependencies">
    <xsl:copy>
      <xsl:apply-templates />
      <!-- Just this version: an app whose other dependency wants another fails in its build, not on a phone. -->
      <dependency>
        <groupId>com.microsoft.onnxruntime</groupId>
        <artifactId>onnxruntime-android</artifactId>
        <version>[<xsl:value-of select="$onnxruntime" />]</version>
        <type>aar</type>
        <scope>runtime</scope>
      </dependency>
    </xsl:copy>
  </xsl:template>

  <!-- CameraX, which no registry of this build has either. -->
  <xsl:template match="m:project[m:artifactId = 'camssf-camerax']/m:dependencies">
    <xsl:copy>
      <xsl:apply-templates />
      <dependency>
        <groupId>androidx.camera</groupId>
        <artifactId>camera-core</artifactId>
        <version><xsl:value-of select="$camerax" /></version>
        <type>aar</type>
        <scope>compile</scope>
      </dependency>
      <dependency>
        <groupId>androidx.camera</groupId>
        <artifactId>camera-camera2</artifactId>
        <version><xsl:value-of select="$camerax" /></version>
        <type>aar</type>
        <scope>compile</scope>
      </dependency>
    </xsl:copy>
  </xsl:template>
</xsl:stylesheet>
