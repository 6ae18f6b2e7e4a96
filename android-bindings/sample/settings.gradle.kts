pluginManagement {
    repositories {
        google()
        mavenCentral()
        gradlePluginPortal()
    }
}

dependencyResolutionManagement {
    repositories {
        google()
        mavenCentral()
        exclusiveContent { // org.camssf from this folder and nowhere else; mvn -f android-bindings verify fills it
            forRepository { maven { url = uri("../packaging/target/repository") } }
            filter { includeGroup("org.camssf") }
        }
    }
}

rootProject.name = "camssf-sample"
