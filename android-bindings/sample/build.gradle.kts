plugins {
    alias(libs.plugins.android)
    alias(libs.plugins.kotlin)
}

android {
    namespace = "org.camssf.sample"
    compileSdk = 36
    defaultConfig {
        applicationId = "org.camssf.sample"
        minSdk = 24
        targetSdk = 36
        versionCode = 1
        versionName = libs.versions.camssf.get()
    }
    buildTypes {
        release {
            isMinifyEnabled = true // with the rules that camssf's artefacts bring
        }
    }
}

kotlin {
    jvmToolchain(17)
}

dependencies {
    implementation(libs.activity)
    implementation(libs.camera.lifecycle)
    implementation(libs.camera.view)
    implementation(libs.camssf.camerax)
    implementation(libs.lifecycle)
}
